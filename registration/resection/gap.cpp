#include "registration/resection/gap.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "meshing/point_location.hpp"
#include "registration/doubts.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/resection/cavity_wall.hpp"
#include "registration/warp.hpp"

namespace tissuewarp::registration {

namespace {

/// Of every tetrahedron, whatever its label.
meshing::TetMesh with_label_one(meshing::TetMesh mesh) {
    mesh.labels.setOnes();
    return mesh;
}

}  // namespace

imaging::Volume gap_after(const Deformation& deformation, const imaging::Volume& resected,
                          const imaging::Volume& fixed_to_moving) {
    imaging::Volume gap = imaging::mask_of_all(warp_labels(resected, fixed_to_moving));
    gap.voxels &= 1;
    const imaging::Volume tissue =
        labels_of_mesh(with_label_one(deformation.deformed_mesh()), fixed_to_moving.geometry);
    gap.voxels.setTo(0, cv::Mat(tissue.voxels != 0));
    return gap;
}

void leave_gap(imaging::Volume& volume, const imaging::Volume& gap, double value) {
    if (!imaging::same_grid(volume.geometry, gap.geometry))
        throw InvalidInput("the gap lies on another grid than what it is to be left in; give that of one field");
    cv::Mat flat = volume.voxels.reshape(volume.channels(), 1);
    flat.setTo(cv::Scalar::all(value), gap.voxels.reshape(1, 1));
}

std::optional<Doubt> doubt_of_gap(const imaging::Volume& gap, const imaging::Volume& fixed_labels) {
    constexpr double most_filled = 0.4;  // walls that sag into it are drawn a voxel off
    const auto voxels = [](const cv::Mat& mask) { return double(cv::countNonZero(mask.reshape(1, 1))); };
    cv::Mat both;
    cv::bitwise_and(imaging::mask_of_all(gap).voxels, imaging::mask_of_all(fixed_labels).voxels, both);
    const double all = voxels(gap.voxels), filled = voxels(both);
    if (!(filled > most_filled * all)) return std::nullopt;
    return Doubt{
        "resected.filled", filled / all, most_filled,
        "the fixed labels show tissue in " + detail::percent(filled / all) + " of the hole that resected tissue leaves",
        "check that this tissue is gone, and that the fixed labels leave the cavity out"};
}

std::vector<bool> points_gone(const Deformation& deformation, const imaging::Volume& resected,
                              const Eigen::Matrix3Xd& points) {
    const meshing::PointLocator left(deformation.mesh);
    std::vector<bool> gone;
    for (const auto& point : points.colwise())
        gone.push_back(detail::label_at(resected, point) != 0 && !left.find(point));
    return gone;
}

}  // namespace tissuewarp::registration
