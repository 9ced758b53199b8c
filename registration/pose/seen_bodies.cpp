#include "registration/pose/seen_bodies.hpp"

#include "imaging/label_extents.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/doubts.hpp"
#include "registration/options.hpp"
#include "registration/pose/finer_motion.hpp"
#include "registration/pose/pose_search.hpp"

#include <string>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using imaging::LabelExtent;
using imaging::Volume;

bool meets_border(const LabelExtent& box, const imaging::Geometry& grid) {
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (box.lower[axis] == 0 || box.upper[axis] == grid.size[static_cast<Eigen::Index>(axis)]) return true;
    return false;
}

/// The map as what alignments ask for, a label alone.
std::unique_ptr<LabelBoundaries> alone(const Volume& labels, const LabelExtent& box, int label) {
    constexpr double about_mm = 20;  // farther off distances grow by those to the grid
    return std::make_unique<LabelBoundaries>(
        imaging::mask_in(labels, imaging::grown(box, voxels_of(about_mm, labels.geometry), labels.geometry), label));
}

}  // namespace

SeenBody::SeenBody(int label, std::unique_ptr<LabelBoundaries> moving, std::unique_ptr<LabelBoundaries> fixed,
                   Observer& observer)
    : moving_(std::move(moving)),
      fixed_(std::move(fixed)),
      distance_(std::make_unique<LabelDistance>(*moving_, *fixed_, seen_body_options.samples)) {
    const auto cost = [&](const Eigen::Affine3d& map, double trim, int stride) {
        return (*distance_)(map, trim, stride);
    };
    const Alignment pose = search_pose(cost, distance_->forward.points(), distance_->backward.points().rowwise().mean(),
                                       PoseFreedom::Rigid, AlignmentOptions(), observer);
    const imaging::Volume from = smooth_distance(moving_->labels()), to = smooth_distance(fixed_->labels());
    const Eigen::Isometry3d motion = finer_motion({moving_->of(LabelBoundaries::of_all).faces, from},
                                                  {fixed_->of(LabelBoundaries::of_all).faces, to}, pose.placement);
    found_ = {label, motion, apart_mm(motion)};
}

double SeenBody::apart_mm(const Eigen::Isometry3d& motion) const {
    return (*distance_)(Eigen::Affine3d(motion.matrix()), AlignmentOptions().trim_mm, 1);
}

bool SeenBody::moved_beside(const Eigen::Isometry3d& placement) const {
    const double apart = apart_mm(placement), gain = apart - found_.apart_mm;
    return gain > seen_body_options.least_gain_mm && gain > seen_body_options.least_gain * apart;
}

std::vector<SeenBody> seen_bodies(const RigidNeighbours& neighbours, const Volume& fixed_labels, Observer& observer) {
    const imaging::LabelExtents moving = imaging::label_extents(neighbours.labels),
                                fixed = imaging::label_extents(fixed_labels);
    std::vector<SeenBody> bodies;
    for (const auto& [label, box] : moving) {
        const auto there = fixed.find(label);
        if (there == fixed.end()) continue;
        const std::string name = "rigid neighbour " + std::to_string(label);
        if (meets_border(box, neighbours.labels.geometry) || meets_border(there->second, fixed_labels.geometry)) {
            observer.note(name + " meets the border of a label map: it moves with the placement");
            continue;
        }
        SeenBody body(label, alone(neighbours.labels, box, label), alone(fixed_labels, there->second, label), observer);
        if (body.found().apart_mm > seen_body_options.most_apart_mm) {
            observer.note(name + " has another shape in the fixed labels (" + to_text(body.found().apart_mm) +
                          " mm apart at best): it moves with the placement");
            continue;
        }
        bodies.push_back(std::move(body));
    }
    return bodies;
}

}  // namespace tissuewarp::registration::detail
