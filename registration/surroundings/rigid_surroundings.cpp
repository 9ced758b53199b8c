#include "registration/surroundings/rigid_surroundings.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/mask_lookup.hpp"
#include "imaging/places.hpp"
#include "imaging/sampling.hpp"
#include "registration/field/held_bodies.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/surroundings/organ_slid.hpp"
#include "registration/surroundings/surroundings_motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissuewarp::registration {

namespace {

using imaging::for_each_place;
using imaging::Geometry;
using imaging::Volume;

/// Chosen by hand on the brain-shift phantom; docs/decisions/rigid_surroundings.md says what they do elsewhere.
struct SurroundingsOptions {
    double spacing_mm = 3.4;       ///< of the places that are looked at
    double motion_spacing_mm = 4;  ///< of those that the motion of the surroundings is found from
    double window_mm = 3.5;        ///< standard deviation of the window around each
    double step_mm = 1.5;          ///< to both sides, along the continued displacement, that no motion is compared with
    double least_structure = 1;    ///< of what such a step leaves over what no motion leaves, beyond that
    double noise_share = 2e-3;     ///< of the image's variance, that no comparison is taken to be more exact than
    double gain = 1.4;             ///< what the continued displacement must leave over what no motion leaves
    double layer_mm = 2.5;         ///< around the organ, that is never rigid
    double most_moved_mm = 8;  ///< of the organ against its surroundings, in the mean, that does not fold between them
    double nearest_mm = 0.3;   ///< motions below it are none
    double negligible_mm = 0.05;  ///< continued displacements below it are not looked at
};
constexpr SurroundingsOptions choice;

/// Of bodies on a grid (as Surroundings::rigid), without what the organ covers, before or after it deformed, and a
/// layer around it that may open or close.
Surroundings beside_organ(Surroundings surroundings, const Deformation& given) {
    const Deformation deformation = given.with_placement(surroundings.motion);
    const auto& mesh = deformation.mesh;
    const meshing::TetMesh deformed{mesh.nodes + deformation.displacement, mesh.tets, mesh.labels};
    const std::vector<Eigen::Isometry3d> motions = detail::against_surroundings(surroundings);
    Volume& rigid = surroundings.rigid;
    const auto near = [](const meshing::TetMesh& organ, const Geometry& grid) {
        return imaging::MaskLookup(imaging::dilate(mask_of_mesh(organ, grid), choice.layer_mm));
    };
    const imaging::MaskLookup before = near(mesh, rigid.geometry),
                              after = near(deformed, detail::grown_by(rigid, motions));
    for_each_place(rigid.geometry, [&](const Eigen::Vector3d& X, std::int64_t n) {
        std::uint8_t& body = rigid.data<std::uint8_t>()[n];
        if (body == 0) return;
        const Eigen::Vector3d moved = body < 2 ? X : motions[std::size_t{body} - 2] * X;
        if (before(X) || after(moved)) body = 0;
    });
    return surroundings;
}

/// A grid along the axes of `image` over the mesh and `reach` mm around it, as far as the image goes.
Geometry grid_around(const meshing::TetMesh& mesh, const Geometry& image, double reach, double spacing) {
    const Eigen::Matrix3Xd index = image.point_to_index() * (mesh.nodes.colwise() - image.origin);
    const Eigen::Array3d margin = reach / image.spacing.array();
    const Eigen::Array3d last = Eigen::Array3d(image.size[0], image.size[1], image.size[2]) - 1.0;
    const Eigen::Array3d lower = (index.rowwise().minCoeff().array() - margin).max(0.0).min(last);
    const Eigen::Array3d upper = (index.rowwise().maxCoeff().array() + margin).max(lower).min(last);
    Geometry grid = image;
    grid.origin = image.point(lower.matrix());
    for (int axis = 0; axis < 3; ++axis) {
        // Not a whole number of voxels: places lie at all phases between them. Interpolation smooths noise between
        // voxels and not on them, which would draw the motion away from where grids agree.
        constexpr double golden = 0.382;
        const double voxels = std::max(1.0, std::round(spacing / image.spacing[axis] - golden)) + golden;
        grid.spacing[axis] = voxels * image.spacing[axis];
        const double length = (upper[axis] - lower[axis]) * image.spacing[axis];
        grid.size[static_cast<std::size_t>(axis)] = std::max(2, static_cast<int>(length / grid.spacing[axis]) + 1);
    }
    return grid;
}

/// A part of an image that holds the points of a grid after a motion, and `margin` mm around it.
Volume part_around(const Volume& image, const Geometry& grid, const Eigen::Isometry3d& motion, double margin) {
    const auto& size = image.geometry.size;
    const Eigen::Array3d edge = margin / image.geometry.spacing.array(), last(size[0], size[1], size[2]);
    Eigen::Array3d lower = last, upper = Eigen::Array3d::Zero();
    for (int corner = 0; corner < 8; ++corner) {
        Eigen::Vector3d index;
        for (int axis = 0; axis < 3; ++axis)
            index[axis] = corner >> axis & 1 ? grid.size[static_cast<std::size_t>(axis)] - 1 : 0;
        const Eigen::Array3d at = image.geometry.index(motion * grid.point(index)).array();
        lower = lower.min(at - edge);
        upper = upper.max(at + edge + 1);
    }
    lower = lower.floor().max(0).min(last - 2);
    upper = upper.ceil().min(last).max(lower + 2);
    const Eigen::Array3i from = lower.cast<int>(), to = upper.cast<int>();
    return imaging::crop(image, {from[0], from[1], from[2]}, {to[0], to[1], to[2]}).as(CV_32F);
}

/// The surroundings in the preoperative image and around them.
detail::Outside outside_of(const Deformation& deformation, const Volume& moving, const Volume& fixed,
                           const Geometry& grid) {
    constexpr double margin_mm = 20;  // that the surroundings may have moved beside the placement
    detail::Outside outside{grid, Volume(grid, CV_32FC1), Volume(grid, CV_32FC1), {}};
    outside.fixed = part_around(fixed, grid, deformation.placement, margin_mm);
    const imaging::LinearSampler preoperative(part_around(moving, grid, Eigen::Isometry3d::Identity(), margin_mm));
    const Volume organ = mask_of_mesh(deformation.mesh, grid);
    for_each_place(grid, [&](const Eigen::Vector3d& X, std::int64_t n) {
        outside.moving.data<float>()[n] = static_cast<float>(preoperative.value(X));
        outside.weight.data<float>()[n] = organ.data<std::uint8_t>()[n] ? 0.0F : 1.0F;
    });
    return outside;
}

/// The intraoperative image as the placement carries it, a step to either side along the continued displacement, and
/// where the continuation goes. Weight 0 in the organ and where the continuation adds nothing.
struct Views {
    Volume weight, still, behind, ahead, moved, length;

    explicit Views(const Geometry& grid)
        : weight(grid, CV_32FC1),
          still(grid, CV_32FC1),
          behind(grid, CV_32FC1),
          ahead(grid, CV_32FC1),
          moved(grid, CV_32FC1),
          length(grid, CV_32FC1) {}
};

Views views_of(const Deformation& deformation, const detail::Continuation& continuation,
               const detail::Outside& outside) {
    Views views(outside.grid);
    const imaging::LinearSampler intraoperative(outside.fixed);
    for_each_place(outside.grid, [&](const Eigen::Vector3d& X, std::int64_t n) {
        if (!(outside.weight.data<float>()[n] > 0)) return;
        const Eigen::Vector3d u = continuation(X), step = choice.step_mm * u.normalized();
        const auto seen = [&](const Eigen::Vector3d& at, Volume& view) {
            const Eigen::Vector3d y = deformation.placement * at;
            view.data<float>()[n] = static_cast<float>(intraoperative.value(y));
            return intraoperative.contains(y);
        };
        const bool still = seen(X, views.still), behind = seen(X - step, views.behind),
                   ahead = seen(X + step, views.ahead), moved = seen(X + u, views.moved);
        views.length.data<float>()[n] = static_cast<float>(u.norm());
        const bool counts = still && behind && ahead && moved && u.norm() > choice.negligible_mm;
        views.weight.data<float>()[n] = counts ? 1.0F : 0.0F;
    });
    return views;
}

/// At least 1 where a place moved with the placement, less the less is said for it.
Volume rigid_score(const Views& views, const Volume& moving) {
    const detail::WindowFit fit(moving.voxels, views.weight, choice.window_mm);
    const cv::Mat still = fit.of(views.still.voxels).residual, behind = fit.of(views.behind.voxels).residual,
                  ahead = fit.of(views.ahead.voxels).residual, moved = fit.of(views.moved.voxels).residual;
    const double noise = choice.noise_share * detail::weighted_variance(moving, views.weight);
    Volume score(views.weight.geometry, CV_32FC1);
    for (std::int64_t n = 0; n < score.geometry.voxel_count(); ++n) {
        if (!(views.weight.data<float>()[n] > 0)) continue;
        const auto at = [n](const cv::Mat& values) { return double{values.ptr<float>()[n]}; };
        const double least = at(still) + noise, structure = 0.5 * (at(behind) + at(ahead)) - at(still);
        if (!(structure > 0)) continue;
        // The minimum of the parabola through the three.
        const double motion = std::abs(choice.step_mm * (at(behind) - at(ahead)) / (4 * structure));
        const double length = views.length.data<float>()[n];
        const double allowed = std::max(0.5 * length, choice.nearest_mm);
        double worst = std::min(structure / (choice.least_structure * least), allowed / std::max(motion, 1e-3));
        if (length > choice.step_mm) worst = std::min(worst, (at(moved) + noise) / (choice.gain * least));
        score.data<float>()[n] = static_cast<float>(std::min(worst, 2.0));
    }
    return score;
}

/// The voxels of the moving image around the mesh.
Geometry voxels_around(const Geometry& image, const Geometry& box) {
    Geometry grid = image;
    const Eigen::Array3d lower = (image.index(box.origin).array() + 1e-6).floor();
    grid.origin = image.point(lower.matrix());
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        const double length = (box.size[a] - 1) * box.spacing[axis] / image.spacing[axis];
        grid.size[a] = std::min(image.size[a] - static_cast<int>(lower[axis]), static_cast<int>(length) + 2);
    }
    return grid;
}

/// How far the organ moved against surroundings of a motion, root mean square over its nodes.
double moved_against(const Deformation& deformation, const Eigen::Isometry3d& motion) {
    const Eigen::Matrix3Xd between = deformation.deformed_nodes() - motion * deformation.mesh.nodes;
    return std::sqrt(between.squaredNorm() / static_cast<double>(between.cols()));
}

bool is_usable(const Volume& image) {
    return image.channels() == 1 && *std::min_element(image.geometry.size.begin(), image.geometry.size.end()) >= 2;
}

}  // namespace

Surroundings rigid_bodies(const Volume& labels, const std::vector<BodyMotion>& seen, const Deformation& deformation) {
    Surroundings surroundings{deformation.placement, imaging::mask_of_all(labels).clone()};
    imaging::Volume& rigid = surroundings.rigid;
    rigid.voxels = cv::min(rigid.voxels, 1);
    for (const BodyMotion& body : seen) {
        surroundings.bodies.push_back(body.motion);
        rigid.voxels.setTo(1 + double(surroundings.bodies.size()), imaging::mask_of(labels, body.label).voxels);
    }
    return beside_organ(std::move(surroundings), deformation);
}

std::optional<Surroundings> rigid_surroundings(const Deformation& given, const Volume& moving, const Volume& fixed,
                                               const FieldOptions& options, Observer& observer) {
    if (!is_usable(moving) || !is_usable(fixed)) return given.surroundings;
    const auto around = [&](double spacing_mm) {
        const Geometry grid = grid_around(given.mesh, moving.geometry, options.fade_mm, spacing_mm);
        return outside_of(given, moving, fixed, grid);
    };
    const auto motion = detail::motion_of_surroundings(around(choice.motion_spacing_mm),
                                                       {given.placement, Eigen::Isometry3d::Identity()});
    if (!motion) return given.surroundings;
    const Deformation deformation = given.with_placement(*motion);
    const detail::Outside outside = around(choice.spacing_mm);
    const detail::MotionsBeside beside = detail::motions_beside(deformation, options.fade_mm);
    const bool slides = detail::organ_slid(deformation, beside, outside);
    if (slides) observer.note(sliding_note);
    if (!slides && moved_against(given, *motion) > choice.most_moved_mm) return given.surroundings;
    const Volume score =
        rigid_score(views_of(deformation, slides ? beside.across : beside.with, outside), outside.moving);
    const bool with_bodies = given.surroundings && !given.surroundings->bodies.empty();  // whole, wherever they are
    const Geometry grid = with_bodies ? moving.geometry : voxels_around(moving.geometry, outside.grid);
    Volume mask(grid, cv::min(imaging::resample(score, grid, imaging::Interpolation::Linear).voxels >= 1.0, 1));
    const imaging::MaskLookup known(given.surroundings ? given.surroundings->rigid : Volume());
    if (!known.empty())
        for_each_place(grid, [&](const Eigen::Vector3d& X, std::int64_t n) {
            if (const std::uint8_t body = known.value(X); body != 0) mask.data<std::uint8_t>()[n] = body;
        });
    Surroundings found{*motion, mask, slides};
    if (with_bodies) found.bodies = given.surroundings->bodies;
    return beside_organ(std::move(found), deformation);
}

}  // namespace tissuewarp::registration
