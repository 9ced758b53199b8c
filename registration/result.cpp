#include "registration/result.hpp"

#include <algorithm>
#include <iterator>

namespace tissuewarp::registration {

std::vector<tled::Spring> LastPulls::of(Origin origin) const {
    std::vector<tled::Spring> result;
    for (const PulledNode& pulled : springs)
        if (pulled.origin == origin) result.push_back(pulled.spring);
    return result;
}

std::vector<PulledNode> LastPulls::data() const {
    std::vector<PulledNode> result;
    std::copy_if(springs.begin(), springs.end(), std::back_inserter(result),
                 [](const PulledNode& pulled) { return pulled.origin == Origin::Datum; });
    return result;
}

std::vector<tled::Spring> LastPulls::placed_by() const {
    if (prior_moves == PriorMoves::WithSurface) return of(Origin::Prior);
    std::vector<tled::Spring> shown;
    if (prior_moves == PriorMoves::Not) return shown;
    for (const PulledNode& pulled : data())
        if (pulled.shows_mm >= 0)
            shown.push_back({pulled.spring.node, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()});
    return shown;
}

const char* name_of(Severity severity) {
    return severity == Severity::Notice ? "notice" : "doubt";
}

std::string full_text(const Doubt& doubt) {
    return doubt.remedy.empty() ? doubt.text : doubt.text + "; " + doubt.remedy;
}

std::vector<std::string> texts(const std::vector<Doubt>& doubts) {
    std::vector<std::string> result;
    for (const Doubt& doubt : doubts) result.push_back(full_text(doubt));
    return result;
}

int count_of_severe(const std::vector<Doubt>& doubts) {
    return static_cast<int>(std::count_if(doubts.begin(), doubts.end(),
                                          [](const Doubt& doubt) { return doubt.severity == Severity::Doubt; }));
}

}  // namespace tissuewarp::registration
