#include "registration/resection/tissue_gone.hpp"

#include "imaging/filters.hpp"
#include "imaging/label_extents.hpp"
#include "imaging/labels.hpp"
#include "registration/doubts.hpp"
#include "registration/field.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/resection/without_counterpart.hpp"
#include "registration/resection/without_structure.hpp"
#include "registration/warp.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

using Eigen::Vector3d;
using imaging::Volume;

namespace {

constexpr double margin_mm = 10;  // about the mesh: what lies beside it tells how grey the organ's surroundings are

template <class Visit>
void for_voxels_of(const Volume& mask, const Visit& visit) {
    const auto& size = mask.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i)
                if (const std::int64_t n = mask.offset(i, j, k); mask.data<std::uint8_t>()[n] != 0)
                    visit(n, mask.geometry.point({double(i), double(j), double(k)}));
}

void leave_what_is_in_view(Volume& mask, const Volume& moved, const FieldOfView& view) {
    for_voxels_of(mask, [&](std::int64_t n, const Vector3d& X) {
        const cv::Vec3f& u = moved.data<cv::Vec3f>()[n];
        if (view.distance(X + Vector3d(u[0], u[1], u[2])) >= 0) mask.data<std::uint8_t>()[n] = 0;
    });
}

/// Pearson's, of as many values.
double correlation(const std::vector<float>& a, const std::vector<float>& b) {
    const Eigen::Map<const Eigen::ArrayXf> x(a.data(), Eigen::Index(a.size())), y(b.data(), Eigen::Index(b.size()));
    const Eigen::ArrayXd u = x.cast<double>() - x.cast<double>().mean(), v = y.cast<double>() - y.cast<double>().mean();
    const double size = u.matrix().norm() * v.matrix().norm();
    return size > 0 ? (u * v).sum() / size : 0;
}

Vector3d middle_of(const Volume& piece) {
    Vector3d sum = Vector3d::Zero();
    double count = 0;
    for_voxels_of(piece, [&](std::int64_t /*n*/, const Vector3d& X) {
        sum += X;
        ++count;
    });
    return sum / count;
}

/// 1 where a label of the first map lies and the second, which has that label too, has none.
Volume lacking_labels(const Volume& shown, const Volume& fixed_labels) {
    const imaging::LabelExtents known = imaging::label_extents(fixed_labels);
    Volume lacking(shown.geometry, CV_8UC1);
    const auto *here = shown.data<std::int32_t>(), *there = fixed_labels.data<std::int32_t>();
    tbb::parallel_for(tbb::blocked_range<std::int64_t>(0, shown.geometry.voxel_count()), [&](const auto& range) {
        for (std::int64_t n = range.begin(); n < range.end(); ++n)
            lacking.data<std::uint8_t>()[n] = here[n] != 0 && there[n] == 0 && known.contains(here[n]);
    });
    return lacking;
}

/// Whether some voxel of a mask has the centres of all faces of the cube of box_mean() about it too. The middle of a
/// cube that the mask holds does, and tissue whose boundary is drawn a voxel off does not: then no mean need be made.
bool may_hold_cube(const Volume& mask, double half_mm) {
    const auto& size = mask.geometry.size;
    std::array<int, 3> half{};
    for (std::size_t axis = 0; axis < 3; ++axis) half[axis] = voxels_of_half(half_mm, mask.geometry, axis);
    const auto holds = [&](std::array<int, 3> voxel) {
        return mask.data<std::uint8_t>()[mask.offset(voxel[0], voxel[1], voxel[2])] != 0;
    };
    const auto is_middle = [&](const std::array<int, 3>& voxel) {
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (const int step : {-half[axis], half[axis]}) {
                std::array<int, 3> face = voxel;
                face[axis] = std::clamp(face[axis] + step, 0, size[axis] - 1);
                if (!holds(face)) return false;
            }
        return true;
    };
    std::atomic<bool> found = false;
    tbb::parallel_for(0, size[2], [&](int k) {
        for (int j = 0; j < size[1] && !found; ++j)
            for (int i = 0; i < size[0]; ++i)
                if (holds({i, j, k}) && is_middle({i, j, k})) found = true;
    });
    return found;
}

}  // namespace

TissueGone tissue_gone(const TissueCubes& cubes, const Deformation& deformation, const Volume& moving,
                       const Volume& fixed, const FieldOfView& view) {
    if (!cubes.may_be_gone(deformation, fixed, view)) return {};
    const imaging::Geometry grid = grid_about(moving.geometry, deformation.mesh.nodes, margin_mm);
    const int reach = static_cast<int>(std::ceil(margin_mm / grid.spacing.minCoeff()));
    const Volume moved = displacement_near_mesh(deformation, grid, reach), organ = mask_of_mesh(deformation.mesh, grid);
    const CavityView pulled_back(warp_image(fixed.as(CV_32F), moved), organ, organ), before(moving, organ, organ);
    Volume core = without_counterpart(pulled_back, before);
    leave_what_is_in_view(core, moved, view);
    std::vector<Volume> cores = pieces_of(core, cavity_options.least_core_ml);
    std::erase_if(cores, [&](const Volume& piece) {
        return std::abs(correlation(values_in(before.grey, piece), values_in(pulled_back.grey, piece))) >=
               tissue_gone_options.least_likeness;
    });
    if (cores.empty()) return {};
    Volume gone(grid, CV_8UC1);
    for (const Volume& piece : cores) gone.voxels |= up_to_wall(pulled_back, piece).voxels;
    gone.voxels &= organ.voxels;
    return {imaging::millilitres(gone), middle_of(cores.front())};
}

TissueGone tissue_unlabelled(const Volume& shown, const Volume& fixed_labels) {
    constexpr float all = 0.999F, any = 1e-6F;  // of boxes of some hundred voxels
    const Volume lacks = lacking_labels(shown, fixed_labels);
    if (!may_hold_cube(lacks, unlabelled_options.half_mm)) return {};
    const Volume lacking = lacks.as(CV_32F);
    Volume within = box_mean(lacking, unlabelled_options.half_mm);
    within.voxels = (within.voxels > all) / 255;
    if (cv::countNonZero(within.voxels.reshape(1, 1)) == 0) return {};
    Volume wide = box_mean(within.as(CV_32F), unlabelled_options.half_mm);
    wide.voxels = (wide.voxels > any) & (lacking.voxels > 0);
    return {imaging::millilitres(wide), middle_of(imaging::mask_of_all(imaging::largest_component(wide)))};
}

namespace {

std::optional<Doubt> doubt_of(const TissueGone& gone, const std::string& what, const std::string& frame) {
    if (gone.ml < cavity_options.least_ml) return std::nullopt;
    const auto at = [&](int axis) { return std::to_string(std::lround(gone.place[axis])); };
    return Doubt{"resected.untold", gone.ml, cavity_options.least_ml,
                 what + " " + to_text(gone.ml) + " ml of where the model has some, most of it about (" + at(0) + ", " +
                     at(1) + ", " + at(2) + ") mm of the " + frame + " frame",
                 "look there; if tissue was resected say so by --resected (a label of it, or auto)"};
}

}  // namespace

std::optional<Doubt> doubt_of_image(const TissueGone& gone, const std::string& name) {
    return doubt_of(gone, "the fixed " + name + " shows fluid, air or nothing in place of tissue in", "moving");
}

std::optional<Doubt> doubt_of_labels(const TissueGone& gone) {
    return doubt_of(gone, "the fixed labels show no tissue in", "fixed");
}

}  // namespace tissuewarp::registration::detail
