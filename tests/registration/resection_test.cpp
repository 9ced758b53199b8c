/// Tissue that is gone by the time of the operation.
#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "registration/record.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/resection/gap.hpp"
#include "registration/resection/tissue_gone.hpp"
#include "registration/resection/without_structure.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/outline.hpp"
#include "registration/update.hpp"
#include "registration/warp.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/textured_phantom.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace tissuewarp::registration {
namespace {

using namespace test;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using imaging::Volume;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using tissuewarp::test::TemporaryFolder;

constexpr int organ = 1, tumour = 2, bone = 3;
constexpr double voxel_mm = 1.5, radius = 30, tumour_radius = 12;
const Vector3d tumour_middle(10, 0, 8);

bool in_tumour(const Vector3d& X) {
    return (X - tumour_middle).norm() < tumour_radius;
}

/// A ball with another in it, and a slab of bone below.
Volume labelled_ball() {
    Volume labels(plain_grid({54, 54, 58}, voxel_mm, {-40.5, -40.5, -46.5}), CV_32SC1);
    for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d X = labels.geometry.point(index);
        int& label = labels.data<std::int32_t>()[n];
        if (X.norm() < radius) label = in_tumour(X) ? tumour : organ;
        if (X[2] < -40) label = bone;
    });
    return labels;
}

PrepareOptions without(std::vector<int> resected) {
    PrepareOptions options;
    options.meshing.edge_length = 6;
    options.rigid_neighbours = {bone};
    options.resected = std::move(resected);
    return options;
}

const PreparedModel& resected_ball() {
    static const PreparedModel model = prepare(labelled_ball(), without({tumour}));
    return model;
}

double dice(const Volume& a, const Volume& b) {
    cv::Mat both;
    cv::bitwise_and(a.voxels, b.voxels, both);
    const auto count = [](const cv::Mat& mask) { return double(cv::countNonZero(mask.reshape(1, 1))); };
    return 2 * count(both) / (count(a.voxels) + count(b.voxels));
}

Volume true_cavity(const imaging::Geometry& grid) {
    Volume truth(grid, CV_8UC1);
    for_each_voxel(truth, [&](const Vector3d& index, std::int64_t n) {
        truth.data<std::uint8_t>()[n] = in_tumour(before_displacement(grid.point(index)));
    });
    return truth;
}

TEST(Resection, LeavesAFreeWall) {
    const PreparedModel& model = resected_ball();
    EXPECT_TRUE((model.model.mesh.labels.array() == organ).all());
    int wall = 0, around = 0;
    for (const InterfaceNode& node : model.interfaces.nodes()) {
        const Vector3d X = model.model.mesh.nodes.col(node.node);
        const bool at_tumour = (X - tumour_middle).norm() < tumour_radius + 2;
        EXPECT_EQ(node.at_cavity, at_tumour) << X.transpose();
        (node.at_cavity ? wall : around) += 1;
    }
    EXPECT_GT(wall, 50);
    const auto springs = detail::ground_springs(model, 1, [](const InterfaceNode&) { return 1.0; });
    const auto weak = std::count_if(springs.begin(), springs.end(), [&](const tled::Spring& spring) {
        const Vector3d X = model.model.mesh.nodes.col(spring.node);
        return (X - tumour_middle).norm() < tumour_radius + 2 && spring.stiffness.trace() < 1e-3;
    });
    EXPECT_EQ(springs.size(), std::size_t(wall + around));
    EXPECT_EQ(weak, wall);
}

TEST(Resection, ComesBackFromAFile) {
    const PreparedModel& model = resected_ball();
    const TemporaryFolder folder;
    write_prepared(model, folder / "resected.h5");
    const PreparedModel back = read_prepared(folder / "resected.h5");
    EXPECT_EQ(back.options.resected, model.options.resected);
    EXPECT_EQ(cv::norm(back.resected.voxels, model.resected.voxels, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(back.labels.voxels, model.labels.voxels, cv::NORM_INF), 0.0);
    for (std::size_t n = 0; n < model.interfaces.nodes().size(); ++n)
        EXPECT_EQ(back.interfaces.nodes()[n].at_cavity, model.interfaces.nodes()[n].at_cavity);
    EXPECT_TRUE(prepare(labelled_ball(), without({})).resected.empty());
}

TEST(Resection, OfLabelsThatCannotBeIsRefused) {
    const auto refuse = [](std::vector<int> resected, const char* words, std::vector<int> anchors = {}) {
        PrepareOptions options = without(std::move(resected));
        options.anchors = std::move(anchors);
        EXPECT_THAT([&] { (void)prepare(labelled_ball(), options); }, ThrowsMessage<InvalidInput>(HasSubstr(words)));
    };
    refuse({7}, "resected tissue: label 7 is absent; present are 1, 2, 3");
    refuse({bone}, "both as rigid neighbour and as resected");
    refuse({tumour}, "both as anchor and as resected", {tumour});
    refuse({organ, tumour}, "nothing is left");
}

/// The hole moves with the tissue about it, and nothing else is one.
TEST(Resection, LeavesAHoleWhereItsTissueWouldBe) {
    const PreparedModel& model = resected_ball();
    const Deformation deformation = deformed_by(model.model.mesh, smooth_displacement);
    const Volume field = displacement_fixed_to_moving(deformation, model.labels.geometry),
                 gap = gap_after(deformation, model.resected, field);
    EXPECT_GT(dice(gap, true_cavity(gap.geometry)), 0.93);
    Volume image = warp_image(sampled(gap.geometry, [](const Vector3d&) { return 7.0; }), field);
    leave_gap(image, gap, -3);
    for (std::int64_t n = 0; n < gap.geometry.voxel_count(); ++n)
        EXPECT_TRUE(!gap.data<std::uint8_t>()[n] || image.data<float>()[n] == -3.0F);
    EXPECT_EQ(image.data<float>()[0], 7.0F);
    const Matrix3Xd points{{10, 10, -20}, {0, 0, 0}, {8, 23, 0}};
    EXPECT_EQ(points_gone(deformation, model.resected, points), (std::vector<bool>{true, false, false}));
}

TEST(Resection, IsPartOfARecord) {
    const PreparedModel& model = resected_ball();
    UpdateResult result;
    result.deformation = deformed_by(model.model.mesh, smooth_displacement);
    const TemporaryFolder folder;
    write_record(model, result, {}, folder / "record.h5");
    const Record record = read_record(folder / "record.h5");
    EXPECT_EQ(record.format_version, 3);
    EXPECT_EQ(cv::norm(record.resected.voxels, model.resected.voxels, cv::NORM_INF), 0.0);
}

UpdateOptions quick() {
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = false;
    options.image.matching.search_mm = 10;
    return options;
}

std::vector<double> node_errors(const UpdateResult& result) {
    std::vector<double> errors;
    const Matrix3Xd found = result.deformation.deformed_nodes();
    for (Eigen::Index n = 0; n < found.cols(); ++n) {
        const Vector3d X = result.deformation.mesh.nodes.col(n);
        errors.push_back((found.col(n) - X - smooth_displacement(X)).norm());
    }
    return errors;
}

/// The ball with its tumour, of whose texture blocks are looked for.
PreparedModel with_image(PreparedModel model) {
    ImageModelOptions image;
    image.features.count = 800;
    image.blocks.grid_spacing_mm = voxel_mm;
    prepare_image(model, sampled(model.labels.geometry, Texture()), image);
    return model;
}

/// What was seen: `filling` in the cavity.
Volume seen_with(const std::function<double(const Vector3d&)>& filling) {
    return sampled(
        labelled_ball().geometry,
        [&](const Vector3d& y) {
            const Vector3d X = before_displacement(y);
            return in_tumour(X) ? filling(y) : Texture()(X);
        },
        0.05);
}

/// Fluid with a texture of its own in the cavity.
TEST(Resection, IsFollowedInAnImage) {
    const PreparedModel model = with_image(prepare(labelled_ball(), without({tumour})));
    for (const auto& point : model.image->blocks.points().colwise())
        EXPECT_GT((point - tumour_middle).norm(), tumour_radius - voxel_mm);
    const Volume seen = seen_with([](const Vector3d& y) { return -2 + 0.5 * Texture()(y + Vector3d(50, 0, 0)); });
    const UpdateResult result = update(model, {.image = seen}, quick());
    const Summary error = summarise(node_errors(result));
    EXPECT_LT(error.mean, 0.35);
    EXPECT_LT(error.percentile_95, 0.9);
    EXPECT_GT(result.min_jacobian, 0);
}

/// The cavity collapsed by 1000 mm³ · 4π/3: its radius fell from 12 to 9 mm, and incompressible tissue followed.
Vector3d before_collapse(const Vector3d& y) {
    const Vector3d from_middle = y - tumour_middle;
    const double r = from_middle.norm();
    return tumour_middle + std::cbrt(1 + 1000 / std::max(1e-9, r * r * r)) * from_middle;
}

/// The wall goes where the image shows it; where it shows none, to where the tissue behind it leaves it.
TEST(Resection, OfACollapsedCavityFollowsItsWall) {
    const PreparedModel model = with_image(prepare(labelled_ball(), without({tumour})));
    const auto seen = [&](bool fluid) {
        return sampled(
            model.labels.geometry,
            [&](const Vector3d& y) {
                const Vector3d X = before_collapse(y);
                return in_tumour(X) ? (fluid ? -2 : Texture()(y + Vector3d(50, 0, 0))) : Texture()(X);
            },
            0.05);
    };
    Volume truth(model.labels.geometry, CV_8UC1);
    for_each_voxel(truth, [&](const Vector3d& index, std::int64_t n) {
        truth.data<std::uint8_t>()[n] = in_tumour(before_collapse(truth.geometry.point(index)));
    });
    const auto agreement = [&](const UpdateResult& result) {
        const Volume field = displacement_fixed_to_moving(result.deformation, truth.geometry);
        return dice(gap_after(result.deformation, model.resected, field), truth);
    };
    const UpdateResult shown = update(model, {.image = seen(true)}, quick()),
                       hidden = update(model, {.image = seen(false)}, quick());
    EXPECT_GT(agreement(shown), 0.88);
    EXPECT_LT(agreement(hidden), 0.85);
    EXPECT_GT(shown.min_jacobian, 0.4);
    EXPECT_THAT(codes(shown.doubts), ::testing::Not(::testing::Contains("resected.no_cavity")));
    EXPECT_THAT(codes(hidden.doubts), ::testing::Contains("resected.no_cavity"));
}

/// The top of the ball sank by up to 7 mm.
Vector3d before_sinking(const Vector3d& y) {
    const double up = std::max(0.0, y[2]) / radius;
    return y + 7 * up * up * Vector3d::UnitZ();
}

/// What a stripped image shows: the tissue, exactly nothing around it; or something around it.
Volume stripped(const imaging::Geometry& grid, const std::function<Vector3d(const Vector3d&)>& before,
                bool shows_around) {
    return sampled(grid, [&](const Vector3d& y) {
        const Vector3d X = before(y);
        if (X.norm() < radius) return in_tumour(X) ? -2 : Texture()(X);
        return shows_around ? Texture()(y + Vector3d(0, 70, 0)) : 0.0;
    });
}

TEST(Resection, TheOuterSurfaceGoesWhereTheImageEnds) {
    const auto model_of = [](bool shows_around) {
        PreparedModel model = prepare(labelled_ball(), without({tumour}));
        ImageModelOptions image;
        image.features.count = 800;
        image.blocks.grid_spacing_mm = voxel_mm;
        prepare_image(model,
                      stripped(
                          model.labels.geometry, [](const Vector3d& X) { return X; }, shows_around),
                      image);
        return model;
    };
    const PreparedModel alone = model_of(false), surrounded = model_of(true);
    const Volume seen = stripped(alone.labels.geometry, before_sinking, false), shown = imaging::mask_of_all(seen);
    EXPECT_NE(detail::outline_term(alone, shown, quick()), nullptr);
    EXPECT_EQ(detail::outline_term(surrounded, shown, quick()), nullptr) << "where it ends nobody knows";
    const UpdateResult result = update(alone, {.image = seen}, quick());
    std::vector<double> off;
    for (const InterfaceNode& node : alone.interfaces.nodes()) {
        if (node.outer != 0 || node.at_cavity) continue;
        const Vector3d y = result.deformation.deformed_nodes().col(node.node);
        if (y[2] > 0) off.push_back(std::abs(before_sinking(y).norm() - alone.model.mesh.nodes.col(node.node).norm()));
    }
    EXPECT_LT(summarise(off).mean, 0.5);
    EXPECT_LT(summarise(off).percentile_95, 1.5);
}

/// Without being told; of air as of fluid, whose grey tissue has too.
TEST(Resection, IsFoundInAnImage) {
    PrepareOptions coarse = without({});
    coarse.meshing.edge_length *= FirstLook().coarser;
    const PreparedModel whole = with_image(prepare(labelled_ball(), coarse));
    const Volume moving = sampled(whole.labels.geometry, Texture());
    for (const double grey : {-4.0, 0.2}) {
        const Volume seen = seen_with([grey](const Vector3d&) { return grey; });
        const UpdateResult first = update(whole, {.image = seen}, for_first_look(quick()));
        const FoundResection found = find_resection(whole, first.deformation, moving, seen);
        EXPECT_GT(dice(found.cavity, true_cavity(seen.geometry)), 0.8);
        EXPECT_GT(dice(found.gone, imaging::mask_of(labelled_ball(), tumour)), 0.8);
        EXPECT_LT(found.deviation, 0.4);
        Deformation rest{whole.model.mesh, Eigen::Matrix3Xd::Zero(3, whole.rest.node_count)};
        EXPECT_TRUE(doubts_of(found, rest, found.cavity).empty());
        EXPECT_LT(found.at_surface_ml, 0.05 * found.gone_ml);
        FoundResection sunk = found;
        sunk.at_surface_ml = 0.5 * found.gone_ml;
        EXPECT_THAT(codes(doubts_of(sunk, rest, found.cavity)), ::testing::ElementsAre("resected.unclear"));
        Volume elsewhere = found.cavity.clone();
        elsewhere.voxels = 1 - elsewhere.voxels;
        EXPECT_THAT(codes(doubts_of(found, rest, elsewhere)), ::testing::ElementsAre("resected.unclear"));
        Deformation squeezed = rest;
        squeezed.displacement = -0.1 * rest.mesh.nodes;
        EXPECT_THAT(codes(doubts_of(found, squeezed, found.cavity)), ::testing::ElementsAre("resected.unclear"));
    }
}

TEST(Resection, IsNotFoundWhereNothingIsGone) {
    const PreparedModel whole = with_image(prepare(labelled_ball(), without({})));
    const Volume moving = sampled(whole.labels.geometry, Texture()),
                 seen =
                     sampled(whole.labels.geometry, [](const Vector3d&y) { return Texture()(before_displacement(y)); });
    const UpdateResult first = update(whole, {.image = seen}, quick());
    const FoundResection found = find_resection(whole, first.deformation, moving, seen);
    EXPECT_EQ(found.gone_ml, 0);
    EXPECT_THAT(codes(doubts_of(found, first.deformation, {})), ::testing::ElementsAre("resected.not_found"));
}

/// Whoever takes all of it for present hears what is not.
TEST(Resection, OfWhichNobodySaysAnythingIsDoubted) {
    const PreparedModel whole = with_image(prepare(labelled_ball(), without({})));
    const auto doubts = [&](const Volume& seen) { return codes(update(whole, {.image = seen}, quick()).doubts); };
    for (const double grey : {-4.0, 0.2})
        EXPECT_THAT(doubts(seen_with([grey](const Vector3d&) { return grey; })), ::testing::Contains("resected.untold"))
            << grey;
    const Volume present =
        sampled(whole.labels.geometry, [](const Vector3d& y) { return Texture()(before_displacement(y)); });
    EXPECT_THAT(doubts(present), ::testing::Not(::testing::Contains("resected.untold")));
}

TEST(Resection, OfWhichLabelsSayNothingIsDoubted) {
    Volume one = labelled_ball();
    one.voxels.setTo(organ, one.voxels == tumour);
    PrepareOptions options = without({});
    const PreparedModel whole = prepare(one, options);
    const auto doubts = [&](bool gone) {
        Volume seen(one.geometry, CV_32SC1);
        for_each_voxel(seen, [&](const Vector3d& index, std::int64_t n) {
            const Vector3d X = before_displacement(seen.geometry.point(index));
            seen.data<std::int32_t>()[n] = X.norm() < radius && !(gone && in_tumour(X)) ? organ : 0;
        });
        return codes(update(whole, {.labels = seen}, quick()).doubts);
    };
    EXPECT_THAT(doubts(true), ::testing::Contains("resected.untold"));
    EXPECT_THAT(doubts(false), ::testing::Not(::testing::Contains("resected.untold")));
}

/// Label maps: the cavity is background in what was seen; what is left of the tumour is told of.
// A cube of two voxels of 1.5 mm to either side of its middle: what is thinner is a boundary drawn a voxel off.
TEST(Resection, UnlabelledTissueIsACubeAtLeast) {
    Volume shown(plain_grid({20, 20, 20}, voxel_mm, {0, 0, 0}), CV_32SC1);
    shown.voxels.setTo(organ);
    const auto without = [&](const std::function<bool(const Vector3d&)>& lacks) {
        Volume labels(shown.geometry, CV_32SC1);
        for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
            labels.data<std::int32_t>()[n] = lacks(index) ? 0 : organ;
        });
        return detail::tissue_unlabelled(shown, labels).ml;
    };
    const auto within = [](const Vector3d& index, int half) {
        return (index - Vector3d(10, 10, 10)).cwiseAbs().maxCoeff() < half + 0.5;
    };
    const int half = detail::voxels_of_half(detail::unlabelled_options.half_mm, shown.geometry, 0);
    EXPECT_EQ(half, 2);
    EXPECT_NEAR(without([&](const Vector3d& index) { return within(index, half); }), 0.125 * 27 / 8, 1e-3);
    EXPECT_EQ(without([&](const Vector3d& index) { return within(index, half - 1); }), 0);
    EXPECT_EQ(without([&](const Vector3d& index) { return std::abs(index[2] - 10) < half - 0.5; }), 0) << "a slab";
    EXPECT_EQ(without([&](const Vector3d& index) {
                  return within(index, half) && (index - Vector3d(10, 10, 10)).cwiseAbs().minCoeff() < 0.5;
              }),
              0)
        << "three plates that cross hold the middles of a cube's faces, and no cube";
}

TEST(Resection, IsFollowedInLabels) {
    const PreparedModel& model = resected_ball();
    Volume seen(model.labels.geometry, CV_32SC1);
    for_each_voxel(seen, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d X = before_displacement(seen.geometry.point(index));
        seen.data<std::int32_t>()[n] = X.norm() < radius && !in_tumour(X) ? organ : 0;
    });
    const UpdateResult result = update(model, {.labels = seen}, quick());
    EXPECT_LT(summarise(node_errors(result)).mean, 1.6);
    EXPECT_TRUE(result.doubts.empty()) << texts(result.doubts).front();

    for_each_voxel(seen, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d X = before_displacement(seen.geometry.point(index));
        if (in_tumour(X) && X[0] < 4) seen.data<std::int32_t>()[n] = tumour;
    });
    EXPECT_THAT(codes(update(model, {.labels = seen}, quick()).doubts), ::testing::Contains("label.vanished"));
}

}  // namespace
}  // namespace tissuewarp::registration
