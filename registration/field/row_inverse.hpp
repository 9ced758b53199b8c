#pragma once
/// The inverse of a continued field along rows of voxels.

#include "registration/field/continuation.hpp"

#include <functional>
#include <mutex>
#include <optional>
#include <utility>

namespace tissuewarp::registration::detail {

/// How far a continued field is inverted. Chosen by hand; on which data is not recorded.
struct RowInverseOptions {
    double negligible_mm = 0.01;  ///< residual before a last step, along a row
    double exact_mm = 1e-3;       ///< the same from rest, which a row begins with
    int steps = 6, halvings = 3;  ///< at most
};
inline constexpr RowInverseOptions row_inverse_options{};

/// A continuation that is made when first asked for, by whichever thread asks.
class LazyContinuation {
public:
    explicit LazyContinuation(std::function<Continuation()> make) : make_(std::move(make)) {}
    /// Thread-safe.
    Eigen::Vector3d operator()(const Eigen::Vector3d& point);

private:
    std::function<Continuation()> make_;
    std::once_flag made_;
    std::optional<Continuation> continuation_;
};

/// w(z) = X − z with X + u(X) = z, u the continued forward field, at consecutive voxels of a row: where two are known
/// the next is guessed from their line, which needs one evaluation in most places; at first, from rest; and where that
/// leads nowhere, from the continued inverse, which few fields need.
class RowInverse {
public:
    RowInverse(const Continuation& forward, LazyContinuation& backward) : forward_(forward), backward_(backward) {}

    /// Voxel i of the row, which lies at z (mm, moving frame); calls come with ascending i.
    Eigen::Vector3d operator()(int i, const Eigen::Vector3d& z);

private:
    const Continuation& forward_;
    LazyContinuation& backward_;
    Eigen::Vector3d before_ = Eigen::Vector3d::Zero(), two_before_ = Eigen::Vector3d::Zero();
    int last_ = -2, known_ = 0;
};

}  // namespace tissuewarp::registration::detail
