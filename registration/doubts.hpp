#pragma once
/// What a registration says against itself, apart from what each term says (terms/).

#include "registration/result.hpp"
#include "registration/schedule.hpp"

namespace tissuewarp::registration::detail {

/// What the course of the rounds and the tissue may show without a doubt. Chosen by hand; on which data is not
/// recorded.
struct CourseDoubtLimits {
    double most_held_back = RoundLimits{}.most_held_back;  ///< share of the matches: more would repeat the round
    double least_jacobian = 0.1;                           ///< det F of an element: no tissue is pressed to a tenth
};
inline constexpr CourseDoubtLimits course_doubt_limits{};

/// Two decimals, for messages.
std::string to_text(double value);

/// "47 %", for messages.
std::string percent(double share);

/// Doubts about the course of the rounds, the tissue and the placement, whatever the data.
std::vector<Doubt> doubts_of_course(const UpdateResult& result);

}  // namespace tissuewarp::registration::detail
