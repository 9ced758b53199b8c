#include "registration/resection/tissue_gone.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/doubts.hpp"
#include "registration/field.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/resection/without_counterpart.hpp"
#include "registration/resection/without_structure.hpp"
#include "registration/warp.hpp"

#include <algorithm>
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
    const std::vector<int> labels = imaging::labels_in(fixed_labels);
    Volume lacking(shown.geometry, CV_32FC1);
    auto* lacks = lacking.data<float>();
    for (std::int64_t n = 0; n < shown.geometry.voxel_count(); ++n) {
        const int label = shown.data<std::int32_t>()[n];
        lacks[n] = float(label != 0 && fixed_labels.data<std::int32_t>()[n] == 0 &&
                         std::binary_search(labels.begin(), labels.end(), label));
    }
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
