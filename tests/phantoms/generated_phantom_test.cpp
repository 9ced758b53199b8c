/// A phantom made here: an organ pressed by a plate, solved by Newton's method on a finer mesh than the registration's,
/// so that the suite measures millimetres without any file.
#include "meshing/mesher.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/update.hpp"
#include "registration/warp.hpp"
#include "tests/support/label_shapes.hpp"
#include "tled/reference/newton.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration {
namespace {

constexpr double depth_mm = 7, plate_radius_mm = 22;

/// The organ's truth: held below, pressed from above (−y) within a radius.
Deformation pressed_organ(const imaging::Volume& labels) {
    tled::Model model;
    meshing::MeshingOptions meshing;
    meshing.edge_length = 5;
    model.mesh = meshing::mesh_labels(labels, meshing);
    model.materials[1] = tled::neo_hookean_lnj(4.0, 0.45);
    model.materials[2] = tled::neo_hookean_lnj(30.0, 0.45);
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions conditions;
    const auto boundary = meshing::boundary_surface(model.mesh);
    for (const int node : boundary.node_of) {
        const Eigen::Vector3d x = model.mesh.nodes.col(node);
        const double r = std::hypot(x[0], x[2]);
        if (x[1] > 15) conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        if (x[1] < 0 && r < plate_radius_mm) {
            const double w = 0.5 + 0.5 * std::cos(EIGEN_PI * r / plate_radius_mm);
            conditions.prescribed.push_back({node, {false, true, false}, {0, depth_mm * w, 0}});
        }
    }
    const auto nodal = tled::nodal_conditions(conditions, rest.node_count);
    const auto solved = tled::newton_equilibrium(rest, nodal, {.tolerance_mm = 1e-4, .load_steps = 2});
    return {model.mesh, solved.displacement, shapes::motion(6, {1, 2, -1}, {5, -3, 4})};
}

/// Points on a regular grid well inside the organ.
Eigen::Matrix3Xd interior_points() {
    const shapes::Organ organ;
    std::vector<Eigen::Vector3d> points;
    for (double x = -40; x <= 40; x += 8)
        for (double y = -32; y <= 32; y += 8)
            for (double z = -24; z <= 24; z += 8)
                if (Eigen::Vector3d(x, y, z).cwiseQuotient(organ.semi_axes).squaredNorm() < 0.8)
                    points.emplace_back(x, y, z);
    Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
    return matrix;
}

TEST(GeneratedPhantom, APressedAndMovedOrganIsRegisteredToAFifthOfAVoxel) {
    const auto moving = shapes::organ_labels({});
    const Deformation truth = pressed_organ(moving);
    const auto fixed = warp_labels(moving, displacement_fixed_to_moving(truth, moving.geometry));
    Landmarks landmarks;
    landmarks.moving = interior_points();
    landmarks.fixed = PointTransform(truth)(landmarks.moving);

    PrepareOptions coarser;
    coarser.meshing.edge_length = 8;
    UpdateOptions options;
    options.device = Device::Cpu;
    const auto result = update(prepare(moving, coarser), {.labels = fixed}, options);
    const TargetError error = target_error(landmarks, PointTransform(result.deformation)(landmarks.moving));

    ASSERT_GT(error.before.count, 150);
    EXPECT_GT(error.before.mean, 7.0);
    EXPECT_LT(error.after.mean, 0.28);           // 0.254, in voxels of 1.5 mm
    EXPECT_LT(error.after.percentile_95, 0.55);  // 0.500
    EXPECT_EQ(mesh_jacobians(result.deformation).folded, 0);
    EXPECT_EQ(field_jacobians(displacement_moving_to_fixed(result.deformation, moving.geometry)).folded, 0);
}

}  // namespace
}  // namespace tissuewarp::registration
