#pragma once
/// The rounds of a registration as data, made before the first of them.

#include "registration/options.hpp"
#include "registration/result.hpp"

#include <algorithm>
#include <vector>

namespace tissuewarp::registration::detail {

/// How far a round looks, and how much it trusts what the model did not follow.
struct RoundPlan {
    int number = 0;
    bool last = false;
    double range_mm = 0;  ///< of the search along normals
    double scale_mm = 0;  ///< of the Geman–McClure weight (σ²/(σ² + d²))², which lowers what the model did not follow
    double most_step_mm = 0;  ///< most that a surface node is asked to move, so that elements are not turned over
    int searches_due = 0;     ///< of an image, this round's included
};

/// When a round counts as done, and by how much the next one looks. Chosen by hand; on which data is not recorded.
struct RoundLimits {
    double most_held_back = 0.02;         ///< share of the matches: with more beyond its step bound a round is repeated
    double settled_before_search_mm = 1;  ///< largest change: a search looks farther than what is left to settle
    double scales_of_range = 3;           ///< a round's search range over the scale of its robust weights
    double first_scale_mm = 1e6;          ///< the first round trusts everything
};

/// When the steps of register.cpp end. Chosen by hand, but for the searches; on which data is not recorded.
struct CourseOptions {
    int rounds_over_planned = 2;  ///< rounds at most, over those planned: the step bound repeats some
    int passes = 4;               ///< of a round at most, while following an equilibrium changes what is asked for
    /// Searches of an image beyond those planned, at most. The brain shift, both sags, the lung and the liver from
    /// their images were looked at while this and SearchGain were chosen (docs/lab/results.md, "Searching on").
    int more_searches = 4;
    int rounds_of_search = 2;  ///< weigh what such a search found
    int load_searches = 2;     ///< unknown loads are looked for so often: the first brings more points within reach
    double most_followed_mm = 0.1;  ///< weight that moves tissue by less beside the first is found by its springs
    int load_rounds = 4;            ///< under the loads found, at most
    int contact_rounds = 10;        ///< that change the contact alone, at most
};
inline constexpr CourseOptions course_options{};

/// Ranges fall geometrically from the first round's to the last's, scales with them. The searches of an image are
/// spread over the rounds: those between only weigh the matches anew.
class Schedule {
public:
    /// `searches` of an image, 0 where there is none.
    Schedule(const UpdateOptions& options, int searches);

    [[nodiscard]] int count() const { return static_cast<int>(rounds_.size()); }
    [[nodiscard]] const RoundPlan& round(int number) const { return rounds_.at(static_cast<std::size_t>(number)); }
    [[nodiscard]] const RoundPlan& last() const { return rounds_.back(); }
    /// The round before it, where there is one.
    [[nodiscard]] const RoundPlan& last_but_one() const { return round(std::max(0, count() - 2)); }
    /// The last round's plan, with so many searches more than were planned.
    [[nodiscard]] RoundPlan last_with_more_searches(int more) const;

    /// The number of the round after one that went so: the same where the step bound held more than 2 % of the matches
    /// back; where hardly anything moved, the next that searches, or the last; count() after the last.
    [[nodiscard]] int after(int number, const Round& record) const;

private:
    std::vector<RoundPlan> rounds_;
    std::vector<int> searches_;  // the round of each
    double settled_mm_;
};

}  // namespace tissuewarp::registration::detail
