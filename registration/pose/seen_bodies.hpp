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
    double least_moved_mm = 0.5;    ///< against the placement, in the mean over its boundary …
    double least_gain_mm = 0.05;    ///< … and by which its boundaries come nearer, in the mean …
    double least_gain = 0.1;        ///< … and as a share of how far apart they were
    double most_turn_deg = 60;      ///< against the placement: beyond, a body is taken to be symmetric
    double most_apart_mm = 2;       ///< of its boundaries afterwards: beyond, they are not of one rigid body
    double exact_apart_mm = 0.5;    ///< likewise, and half a voxel: beyond, a note says so
    double least_depth_mm = 3;      ///< of a body: fields carry a thinner one less exactly, which a note says
    std::size_t fewest_faces = 60;  ///< between voxels, of its boundary: smaller ones are left
    std::size_t most_bodies = 253;  ///< that the mask of Surroundings can tell apart
    int samples = 4000;             ///< boundary points, half from each map
};

/// One label in both maps.
class SeenBody {
public:
    /// Its boundaries in the moving and the fixed frame, made, and neither without faces.
    SeenBody(int label, std::unique_ptr<LabelBoundaries> moving, std::unique_ptr<LabelBoundaries> fixed);

    [[nodiscard]] int label() const { return label_; }
    /// How it moved: by the rigid motion that brings its boundaries together, sought from the placement; or with the
    /// placement, by SeenBodyOptions. Notes what speaks against the former. Throws Cancelled.
    [[nodiscard]] BodyMotion motion(const Eigen::Isometry3d& placement, Observer& observer) const;

private:
    int label_;
    std::unique_ptr<LabelBoundaries> moving_, fixed_;
    std::unique_ptr<LabelDistance> distance_;

    /// Mean distance of the boundaries after a motion, mm.
    [[nodiscard]] double apart_mm(const Eigen::Isometry3d& motion) const;
    [[nodiscard]] Eigen::Isometry3d best_from(const Eigen::Isometry3d& placement, Observer& observer) const;
    /// Of a body that moved on its own.
    void note_what_is_inexact(double apart, Observer& observer) const;
};

/// The neighbours that both maps show whole. Where the fixed map shows any, a note says which of the others it does not
/// show, or not whole, or that are too small to be followed.
std::vector<SeenBody> seen_bodies(const RigidNeighbours& neighbours, const imaging::Volume& fixed_labels,
                                  Observer& observer);

}  // namespace tissuewarp::registration::detail
