#pragma once
/// Springs that draw the outer surface along its normals to a boundary that an image shows.

#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/term.hpp"

#include <cstddef>
#include <functional>
#include <vector>

namespace tissuewarp::registration::detail {

class BoundaryPull {
public:
    /// How far a node of the interfaces is from the boundary, mm along its outward normal from where it is (both in the
    /// fixed frame); NaN where it is drawn to none.
    using Ahead = std::function<double(std::size_t entry, const Eigen::Vector3d& place, const Eigen::Vector3d& normal)>;

    /// Model and options outlive this.
    BoundaryPull(const PreparedModel& prepared, const UpdateOptions& options);

    /// Springs as labels have them, of data of a kind; candidates are left to the caller.
    [[nodiscard]] Contribution towards(const Ahead& ahead_mm, const DatumKind& kind, const RoundPlan& plan,
                                       const State& state) const;

private:
    const PreparedModel& prepared_;
    const UpdateOptions& options_;
    std::vector<std::vector<int>> neighbours_;  // of interface nodes
};

}  // namespace tissuewarp::registration::detail
