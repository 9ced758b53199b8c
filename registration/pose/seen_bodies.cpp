#include "registration/pose/seen_bodies.hpp"

#include "imaging/label_extents.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/doubts.hpp"
#include "registration/options.hpp"
#include "registration/pose/finer_motion.hpp"
#include "registration/pose/pose_search.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::Isometry3d;
using imaging::LabelExtent;
using imaging::Volume;

constexpr SeenBodyOptions options;
constexpr int all = LabelBoundaries::of_all;

bool meets_border(const LabelExtent& box, const imaging::Geometry& grid) {
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (box.lower[axis] == 0 || box.upper[axis] == grid.size[static_cast<Eigen::Index>(axis)]) return true;
    return false;
}

/// The label alone, as alignments ask for it, with distances on its own voxels: coarser ones miss thin parts.
std::unique_ptr<LabelBoundaries> alone(const Volume& labels, const LabelExtent& box, int label) {
    constexpr double about_mm = 20, as_it_is = 0;  // farther off distances grow by those to the grid
    auto boundaries = std::make_unique<LabelBoundaries>(
        imaging::mask_in(labels, imaging::grown(box, voxels_of(about_mm, labels.geometry), labels.geometry), label),
        as_it_is);
    boundaries->make({all});
    return boundaries;
}

std::string name_of_body(int label) {
    return "rigid neighbour " + std::to_string(label);
}

/// Why a label is not followed by itself; empty where it is.
std::string why_left(const Volume& moving, const LabelExtent& box, const Volume& fixed, const LabelExtent& there) {
    if (there.voxels == 0) return " is not in the fixed labels";
    if (meets_border(box, moving.geometry) || meets_border(there, fixed.geometry))
        return " meets the border of a label map";
    return "";
}

double turn_deg(const Isometry3d& motion) {
    return Eigen::AngleAxisd(motion.linear()).angle() * 180 / EIGEN_PI;
}

}  // namespace

SeenBody::SeenBody(int label, std::unique_ptr<LabelBoundaries> moving, std::unique_ptr<LabelBoundaries> fixed)
    : label_(label),
      moving_(std::move(moving)),
      fixed_(std::move(fixed)),
      distance_(std::make_unique<LabelDistance>(*moving_, *fixed_, options.samples)) {}

double SeenBody::apart_mm(const Isometry3d& motion) const {
    return (*distance_)(Eigen::Affine3d(motion.matrix()), AlignmentOptions().trim_mm, 1);
}

Isometry3d SeenBody::best_from(const Isometry3d& placement, Observer& observer) const {
    const auto cost = [&](const Eigen::Affine3d& map, double trim, int stride) {
        return (*distance_)(map * Eigen::Affine3d(placement.matrix()), trim, stride);
    };
    const Alignment pose =
        search_pose(cost, placement * distance_->forward.points(), distance_->backward.points().rowwise().mean(),
                    PoseFreedom::Rigid, AlignmentOptions(), observer);
    const Volume from = smooth_distance(moving_->labels()), to = smooth_distance(fixed_->labels());
    return finer_motion({moving_->of(all).faces, from}, {fixed_->of(all).faces, to}, pose.placement * placement);
}

void SeenBody::note_what_is_inexact(double apart, Observer& observer) const {
    const double voxel =
        std::max(moving_->labels().geometry.spacing.maxCoeff(), fixed_->labels().geometry.spacing.maxCoeff());
    if (apart > options.exact_apart_mm + 0.5 * voxel)
        observer.note(name_of_body(label_) + " moved on its own, but its boundaries stay " + to_text(apart) +
                      " mm apart: another shape, or pieces that moved each by itself");
    double deepest = 0;
    cv::minMaxLoc(moving_->of(all).distance.voxels.reshape(1, 1), &deepest, nullptr);
    if (-deepest < options.least_depth_mm)
        observer.note(name_of_body(label_) + " is thin: the fields carry it to a millimetre or two only");
}

BodyMotion SeenBody::motion(const Isometry3d& placement, Observer& observer) const {
    const std::string name = name_of_body(label_);
    const BodyMotion left{label_, false, placement, apart_mm(placement)};
    const BodyMotion found{label_, true, best_from(placement, observer), 0};
    const double apart = apart_mm(found.motion), gain = left.apart_mm - apart;
    const Eigen::Matrix3Xd& points = distance_->forward.points();
    const double moved = (found.motion * points - placement * points).colwise().norm().mean();
    if (apart > options.most_apart_mm) {
        observer.note(name + " has another shape in the fixed labels (" + to_text(apart) +
                      " mm apart at best): it is not followed by itself");
        return left;
    }
    if (moved < options.least_moved_mm || gain < options.least_gain_mm || gain < options.least_gain * left.apart_mm)
        return left;
    if (const double turn = turn_deg(placement.inverse() * found.motion); turn > options.most_turn_deg) {
        observer.note(name + " fits best turned by " + to_text(turn) +
                      "°, as a symmetric one may: it is not followed by itself");
        return left;
    }
    note_what_is_inexact(apart, observer);
    return {label_, true, found.motion, apart};
}

std::vector<SeenBody> seen_bodies(const RigidNeighbours& neighbours, const Volume& fixed_labels, Observer& observer) {
    const imaging::LabelExtents moving = imaging::label_extents(neighbours.labels),
                                fixed = imaging::label_extents(fixed_labels);
    const auto in_fixed = [&](int label) {
        const auto there = fixed.find(label);
        return there == fixed.end() ? LabelExtent{} : there->second;
    };
    if (std::none_of(moving.begin(), moving.end(), [&](const auto& body) { return in_fixed(body.first).voxels > 0; }))
        return {};
    std::vector<SeenBody> bodies;
    for (const auto& [label, box] : moving) {
        const LabelExtent there = in_fixed(label);
        std::string why = why_left(neighbours.labels, box, fixed_labels, there);
        if (why.empty()) {
            auto before = alone(neighbours.labels, box, label), after = alone(fixed_labels, there, label);
            const auto faces = std::min(before->of(all).faces.cols(), after->of(all).faces.cols());
            if (static_cast<std::size_t>(faces) < options.fewest_faces)
                why = " is too small";
            else if (bodies.size() == options.most_bodies)
                why = " is one of too many";
            else
                bodies.emplace_back(label, std::move(before), std::move(after));
        }
        if (!why.empty()) observer.note(name_of_body(label) + why + ": it is not followed by itself");
    }
    return bodies;
}

}  // namespace tissuewarp::registration::detail
