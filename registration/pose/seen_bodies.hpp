#pragma once
/// Rigid neighbours of the organ that fixed labels show, bone by bone: vertebrae of a spine that bent, a hip that
/// turned.

#include "core/observer.hpp"
#include "registration/pose/label_distance.hpp"
#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <Eigen/Geometry>

#include <memory>
#include <vector>

namespace tissuewarp::registration::detail {

/// When a body is taken to have moved on its own. Chosen by hand.
struct SeenBodyOptions {
    double least_gain_mm = 0.15;  ///< by which its boundaries come nearer, in the mean, than with the placement …
    double least_gain = 0.2;      ///< … and as a share of that
    double most_apart_mm = 2;     ///< of its boundaries afterwards: beyond, they are not of one rigid body
    int samples = 4000;           ///< boundary points, half from each map
};
inline constexpr SeenBodyOptions seen_body_options{};

/// One label in both maps, and the rigid motion that brings its boundaries together.
class SeenBody {
public:
    /// Its boundaries in the moving and the fixed frame. Throws Cancelled.
    SeenBody(int label, std::unique_ptr<LabelBoundaries> moving, std::unique_ptr<LabelBoundaries> fixed,
             Observer& observer);

    [[nodiscard]] const BodyMotion& found() const { return found_; }
    /// Mean distance of the boundaries after another motion, mm.
    [[nodiscard]] double apart_mm(const Eigen::Isometry3d& motion) const;
    /// By SeenBodyOptions.
    [[nodiscard]] bool moved_beside(const Eigen::Isometry3d& placement) const;

private:
    std::unique_ptr<LabelBoundaries> moving_, fixed_;
    std::unique_ptr<LabelDistance> distance_;
    BodyMotion found_;
};

/// Of the neighbours that both maps show whole; those that the border of an image cuts are left to the placement, and
/// those whose boundaries stay apart, each with a note. Throws Cancelled.
std::vector<SeenBody> seen_bodies(const RigidNeighbours& neighbours, const imaging::Volume& fixed_labels,
                                  Observer& observer);

}  // namespace tissuewarp::registration::detail
