/// The real head with a simulated craniotomy, solved by an independent finite-element code: registration from labels
/// alone, scored by landmarks that it never saw.
#include "imaging/image_io.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/update.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration {
namespace {

const std::filesystem::path head = std::filesystem::path(TISSUEWARP_SOURCE_DIR) / "data" / "brainshift";

TEST(HeadPhantom, LabelsAloneBringMovedTargetsWithinAMillimetre) {
    const auto moving = imaging::read_labels(head / "preop_labels.nii.gz");
    const auto fixed = imaging::read_labels(head / "intraop_labels.nii.gz");
    const Landmarks landmarks = read_landmarks(head / "landmarks.csv");

    UpdateOptions options;
    options.device = Device::Cpu;
    const auto result = update(prepare(moving), {.labels = fixed}, options);
    const TargetError error = target_error(landmarks, PointTransform(result.deformation)(landmarks.moving));

    EXPECT_EQ(error.moved_before.count, 57);
    EXPECT_GT(error.moved_before.mean, 3.5);
    EXPECT_LT(error.moved_after.mean, 0.7);
    EXPECT_LT(error.moved_after.percentile_95, 1.5);
    EXPECT_LT(error.after.mean, 0.5);
    EXPECT_TRUE(result.doubts.empty());

    const auto forward = displacement_moving_to_fixed(result.deformation, moving.geometry);
    EXPECT_EQ(field_jacobians(forward).folded, 0);
    EXPECT_EQ(mesh_jacobians(result.deformation).folded, 0);
}

}  // namespace
}  // namespace tissuewarp::registration
