#include "tests/phantoms/claims.hpp"

#include "imaging/image_io.hpp"
#include "imaging/sampling.hpp"
#include "registration/field.hpp"

#include <vector>

namespace tissuewarp::registration::claims {

void expect(const Claim& claim, const Summary& before, const Summary& after) {
    EXPECT_EQ(before.count, claim.count);
    EXPECT_NEAR(before.mean, claim.before, 0.006);  // as rounded
    EXPECT_LE(after.mean, claim.room * claim.mean);
    EXPECT_LE(after.percentile_95, claim.room * claim.percentile_95);
}

TargetError error_of(const UpdateResult& result, const Landmarks& targets) {
    return target_error(targets, PointTransform(result.deformation)(targets.moving));
}

void expect_unfolded(const Deformation& deformation, const imaging::Volume& moving) {
    EXPECT_EQ(mesh_jacobians(deformation).folded, 0);
    EXPECT_EQ(field_jacobians(displacement_moving_to_fixed(deformation, moving.geometry)).folded, 0);
}

Landmarks field_targets(const std::filesystem::path& field_path, const std::filesystem::path& mask_path) {
    const imaging::Volume field = imaging::read_volume(field_path);
    const imaging::LinearSampler mask(imaging::read_labels(mask_path).as(CV_32F));
    std::vector<Eigen::Vector3d> from, to;
    const auto& size = field.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                const Eigen::Vector3d point = field.geometry.point({double(i), double(j), double(k)});
                if (!(mask.value(point) > 0.999F)) continue;
                const auto& u = field.data<cv::Vec3f>()[field.offset(i, j, k)];
                from.push_back(point);
                to.emplace_back(point + Eigen::Vector3d(u[0], u[1], u[2]));
            }
    const auto matrix = [](const std::vector<Eigen::Vector3d>& points) -> Eigen::Matrix3Xd {
        return Eigen::Matrix3Xd::Map(points.data()->data(), 3, static_cast<Eigen::Index>(points.size()));
    };
    return {matrix(from), matrix(to)};
}

UpdateOptions on_cpu(bool align) {
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = align;
    return options;
}

PrepareOptions without_fixed_labels(const imaging::Volume& moving_labels) {
    PrepareOptions options;
    options.meshing.edge_length = suggested_edge_length_without_labels(moving_labels);
    return options;
}

PreparedModel prepared_with_image(const imaging::Volume& moving_labels, const imaging::Volume& moving,
                                  const PrepareOptions& options) {
    PreparedModel prepared = prepare(moving_labels, options);
    prepare_image(prepared, moving);
    return prepared;
}

}  // namespace tissuewarp::registration::claims
