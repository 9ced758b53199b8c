/// Several images of one tissue, each of which shows a part of what moves.
#include "registration/update.hpp"

#include "core/errors.hpp"
#include "registration/evaluation.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "registration/uncertainty.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/textured_phantom.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <numeric>

namespace tissuewarp::registration {
namespace {

using namespace test;
using imaging::Volume;

constexpr double spacing_mm = 1.5;

/// Which side of the organ has structure in a contrast.
enum class Side { Left, Right };

/// Texture that fades out towards the other side.
double shown(Side side, const Eigen::Vector3d& x) {
    const double across = side == Side::Left ? -x[0] : x[0];
    return Texture()(x) * std::clamp(0.5 + across / 6, 0.0, 1.0);
}

Volume before(const PreparedModel& prepared, Side side) {
    return sampled(
        prepared.labels.geometry, [&](const auto& x) { return shown(side, x); }, 0.02, 5);
}

Volume after(const PreparedModel& prepared, Side side) {
    return sampled(
        prepared.labels.geometry, [&](const auto& y) { return shown(side, before_displacement(y)); }, 0.02, 6);
}

ImageModelOptions image_options() {
    ImageModelOptions options;
    options.features.count = 800;
    options.blocks.grid_spacing_mm = spacing_mm;
    return options;
}

PreparedModel model(const std::vector<Side>& sides) {
    shapes::Organ organ;
    organ.semi_axes = {30, 26, 24};
    organ.inclusion_radius = 0;
    PrepareOptions options;
    options.meshing.edge_length = 6;
    PreparedModel prepared = prepare(shapes::organ_labels(organ, Eigen::Isometry3d::Identity(), spacing_mm), options);
    prepare_image(prepared, before(prepared, sides.front()), image_options());
    for (std::size_t n = 1; n < sides.size(); ++n)
        prepare_contrast(prepared, before(prepared, sides[n]), image_options());
    return prepared;
}

UpdateOptions quick() {
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = false;
    options.image.matching.search_mm = 10;
    return options;
}

double mean_error(const UpdateResult& result) {
    const Eigen::Matrix3Xd found = result.deformation.deformed_nodes(), &nodes = result.deformation.mesh.nodes;
    double sum = 0;
    for (Eigen::Index n = 0; n < found.cols(); ++n) {
        const Eigen::Vector3d x = nodes.col(n);
        sum += (found.col(n) - x - smooth_displacement(x)).norm();
    }
    return sum / double(found.cols());
}

// A contrast that is left out, or that pulls towards the other one's places, leaves one side where it was: the organ
// moves by 4 mm on average.
TEST(Contrasts, TogetherShowWhatEachAloneDoesNot) {
    const PreparedModel left = model({Side::Left}), right = model({Side::Right}),
                        both = model({Side::Left, Side::Right});
    const double left_mm = mean_error(update(left, {.image = after(left, Side::Left)}, quick())),
                 right_mm = mean_error(update(right, {.image = after(right, Side::Right)}, quick()));
    const UpdateResult result =
        update(both, {.image = after(both, Side::Left), .contrasts = {after(both, Side::Right)}}, quick());
    EXPECT_LT(mean_error(result), 0.35);
    EXPECT_GT(std::min(left_mm, right_mm), 2 * mean_error(result));
    ASSERT_EQ(result.images.size(), 2u);
    EXPECT_GT(result.images[1].matched, 100);
}

TEST(Contrasts, AModelOnDiskKeepsThem) {
    const PreparedModel prepared = model({Side::Left, Side::Right});
    const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "contrasts.tw";
    write_prepared(prepared, path);
    const PreparedModel read = read_prepared(path);
    std::filesystem::remove(path);
    const Intraoperative seen{.image = after(prepared, Side::Left), .contrasts = {after(prepared, Side::Right)}};
    EXPECT_EQ(update(prepared, seen, quick()).deformation.displacement,
              update(read, seen, quick()).deformation.displacement);
}

TEST(Contrasts, ExchangedOnesAreDoubtedByName) {
    const PreparedModel prepared = model({Side::Left, Side::Right});
    Volume other = sampled(
        prepared.labels.geometry, [](const auto& x) { return Texture()(2.0 * x + Eigen::Vector3d(9, 4, 1)); }, 0.02, 6);
    const UpdateResult result =
        update(prepared, {.image = after(prepared, Side::Left), .contrasts = {std::move(other)}}, quick());
    const auto about_contrast = [](const Doubt& doubt) { return doubt.text.find("contrast 2") != std::string::npos; };
    EXPECT_TRUE(std::any_of(result.doubts.begin(), result.doubts.end(), about_contrast));
}

TEST(Contrasts, WhatHasNoPairIsRefused) {
    PreparedModel prepared = model({Side::Left});
    const Volume image = after(prepared, Side::Left);
    EXPECT_THROW(update(prepared, {.image = image, .contrasts = {image}}, quick()), InvalidInput);
    EXPECT_THROW(update(prepared, {.labels = prepared.labels, .contrasts = {image}}, quick()), InvalidInput);
    prepared.image.reset();
    EXPECT_THROW(prepare_contrast(prepared, image), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
