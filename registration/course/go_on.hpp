#pragma once
/// Updates that begin where the last one ended, and when they may.

#include "registration/intraoperative.hpp"
#include "registration/loads/load_finder.hpp"
#include "registration/options.hpp"
#include "registration/result.hpp"

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <string>

namespace tissuewarp::registration::detail {

/// When the result of an update that went on from an earlier one is not taken.
struct GoOnLimits {
    /// From the earlier result, root mean square over the nodes: farther than the last rounds look for what they match,
    /// tissue may have been drawn to something else. By hand, as the search range of the last round. Not the most of a
    /// node: where no datum is near, noise of few points moves tissue so far.
    double most_step_mm = 4;
    /// From the update that last sought the placement: poses and loads are of what was seen then. By hand.
    double most_motion_mm = 15;
    int most_in_a_row = 50;    ///< updates, then the placement is sought again. By hand
    double most_growth = 1.2;  ///< of the data over those of that update: more may tell another pose. By hand
    /// The last round's residual over that of the earlier result, beside a tenth of a millimetre. By hand.
    double most_residual = 1.25;
    double residual_slack_mm = 0.1;
};
inline constexpr GoOnLimits go_on_limits{};

/// The rounds of such an update.
struct GoOnCourse {
    /// That look for what they match. Chosen on labels of the brain shift and the liver's surface
    /// (docs/lab/performance.md).
    int rounds = 3;
    int load_rounds = 4;     ///< at most, each under loads found anew. By hand
    double load_step = 0.5;  ///< a round answers loads by less than linear tissue: whole steps swing about the end
    double settled_loads_mm = 0.05;  ///< a change of the loads that moves tissue by less is the last. By hand
    double most_growth = 2;          ///< over the change before: they do not lead to loads that data show. By hand
    double most_load_change_mm = 3;  ///< as much at once does not either. By hand
};
inline constexpr GoOnCourse go_on_course{};

/// How much was seen of what may grow while it is gathered.
struct AmountSeen {
    double surface = 0;  ///< share of the organ's surface
    int pairs = 0, curve_points = 0;
};
AmountSeen amount_seen(const UpdateResult& result);

/// What a result leaves to updates that go on from it.
struct CarriedOn {
    Eigen::Matrix3Xd nodes;  ///< 3 × N, mm, fixed frame, in the update that last sought the placement
    AmountSeen seen;         ///< by that update
    int since = 0;           ///< updates that have gone on since
    FoundLoads loads;        ///< those that nobody stated
};

/// Whether data of the kinds are seen that an earlier update had.
bool same_kinds(const UpdateResult& last, const Intraoperative& seen);

/// The options of a short course: few rounds that look no farther than the last one of a whole course, and of an image
/// blocks and one dense search on the last grid.
UpdateOptions short_course(UpdateOptions options);

/// Why an update that went on from `last` to `now` must begin anew; nothing where it need not.
std::optional<std::string> why_begin_anew(const UpdateResult& last, const UpdateResult& now,
                                          const GoOnLimits& limits = go_on_limits);

}  // namespace tissuewarp::registration::detail
