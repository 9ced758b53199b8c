#include "registration/doubts.hpp"

#include "registration/pose/shown_motions.hpp"

#include <cmath>
#include <cstdio>
#include <utility>

namespace tissuewarp::registration::detail {

std::string to_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f", value);
    return text;
}

std::string percent(double share) {
    return std::to_string(std::lround(100 * share)) + " %";
}

std::vector<Doubt> doubts_of_course(const UpdateResult& result) {
    constexpr CourseDoubtLimits limits = course_doubt_limits;
    std::vector<Doubt> doubts;
    const Round& last = result.rounds.back();
    if (last.held_back > limits.most_held_back * last.matched)
        doubts.push_back({"rounds.held_back", last.held_back / double(last.matched), limits.most_held_back,
                          std::to_string(last.held_back) + " of " + std::to_string(last.matched) +
                              " matches are still far from where they belong",
                          "allow more rounds"});
    if (result.cut_short)
        doubts.push_back({"rounds.cut_short", last.largest_change_mm, 0,
                          "the time budget ended the registration after " + std::to_string(result.rounds.size()) +
                              " rounds, the last of which still moved tissue by " + to_text(last.largest_change_mm) +
                              " mm",
                          "allow more time, or a coarser mesh"});
    if (result.min_jacobian < limits.least_jacobian)
        doubts.push_back({"tissue.compressed", result.min_jacobian, limits.least_jacobian,
                          "tissue is compressed to " + to_text(result.min_jacobian) + " of its volume in one element",
                          "look there: labels or matches that pull against each other press tissue so"});
    if (auto doubt = doubt_of_placement(result.pulls, result.deformation.mesh.nodes))
        doubts.push_back(std::move(*doubt));
    return doubts;
}

}  // namespace tissuewarp::registration::detail
