#pragma once
/// A registration tests itself: whole regions of the data are left out and predicted from the rest, and what is missed
/// is set against what the error estimate says of it.

#include "registration/loads/loaded_posterior.hpp"
#include "registration/uncertainty.hpp"
#include "registration/uncertainty/linear_registration.hpp"

#include <optional>

namespace tissuewarp::registration::detail {

struct HeldOutOptions {
    int regions = 12;  ///< that the data are cut into, as far apart as they can be
    int folds = 4;     ///< each leaves out every fourth region
    int draws = 16;    ///< of truths and of errors, that tell what is to be expected
    /// Of so many nodes that data pull at the springs of a fold are taken out of the inverse between these nodes
    /// (Woodbury), at a fraction of the time of a factor; of more each fold has a factor. Set by hand.
    int most_nodes_between = 250;
};

/// Error that the mean of each region left out was predicted with over the one that was to be expected, root of the
/// mean square: 1 where the estimate is right, more where it promises too much. Nothing where there are too few
/// data to leave any out. `all` is the posterior of all pulls, `truths` are displacements that the organ may have (3N ×
/// k, mm), `errors` of the data as many.
std::optional<HeldOut> held_out(const PreparedModel& prepared, const LastPulls& pulls, const LoadedPosterior& all,
                                const Eigen::Matrix3Xd& displacement, const Eigen::MatrixXd& truths,
                                const DataErrors& errors, const HeldOutOptions& options = {});

}  // namespace tissuewarp::registration::detail
