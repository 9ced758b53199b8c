/// Tissue whose parts slide on one another.
#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "registration/springs/slid_surfaces.hpp"
#include "registration/uncertainty.hpp"
#include "registration/uncertainty/slip_motions.hpp"
#include "registration/update.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration {
namespace {

using namespace test;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using tissuewarp::test::TemporaryFolder;

constexpr int lower = 1, upper = 2;
constexpr double edge_mm = 40, slid_mm = 6;

/// A cube whose upper half is a label of its own.
meshing::TetMesh two_layers() {
    meshing::TetMesh mesh = box_at({0, 0, 0}, {edge_mm, edge_mm, edge_mm}, {6, 6, 6});
    for (int t = 0; t < mesh.tet_count(); ++t)
        mesh.labels[t] = mesh.nodes(2, mesh.tets.col(t)).mean() < edge_mm / 2 ? lower : upper;
    return mesh;
}

imaging::Volume layer_labels() {
    imaging::Volume labels(plain_grid({30, 30, 30}, 2, {-9, -9, -9}), CV_32SC1);
    for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d X = labels.geometry.point(index);
        const bool in = (X.array() > 0).all() && (X.array() < edge_mm).all();
        labels.data<std::int32_t>()[n] = !in ? 0 : X[2] < edge_mm / 2 ? lower : upper;
    });
    return labels;
}

PreparedModel prepared_with(std::vector<std::array<int, 2>> sliding) {
    PrepareOptions options;
    options.sliding = std::move(sliding);
    return prepare(two_layers(), layer_labels(), options);
}

/// The upper half went along x, the lower one did not.
Vector3d gone(const Vector3d& X) {
    return X + (X[2] > edge_mm / 2 ? slid_mm : 0) * Vector3d::UnitX();
}

PointPairs pairs() {
    Matrix3Xd moving(3, 128);
    for (int n = 0; n < 128; ++n) moving.col(n) << 5 + 10 * (n % 4), 5 + 10 * (n / 4 % 4), 2.5 + 5 * (n / 16);
    PointPairs pairs;
    pairs.moving = pairs.fixed = moving;
    for (auto place : pairs.fixed.colwise()) place = gone(place);
    pairs.deviation_mm = 0.3;
    return pairs;
}

UpdateOptions where_headers_have_it() {
    UpdateOptions options;
    options.align = false;
    options.device = Device::Cpu;
    return options;
}

UpdateResult registered(const PreparedModel& prepared) {
    Intraoperative seen;
    seen.points = pairs();
    return update(prepared, seen, where_headers_have_it());
}

/// Largest error next to the surface along which the halves slid.
double error_beside_it(const UpdateResult& result) {
    Matrix3Xd places(3, 50);
    for (int n = 0; n < 50; ++n) places.col(n) << 4 + 8 * (n % 5), 4 + 8 * (n / 5 % 5), edge_mm / 2 + (n < 25 ? -1 : 1);
    Matrix3Xd truth = places;
    for (auto place : truth.colwise()) place = gone(place);
    return (PointTransform(result.deformation)(places) - truth).colwise().norm().maxCoeff();
}

/// The same halves, bent so that they meet in a part of a sphere.
constexpr double radius_mm = 60;
const Vector3d middle(edge_mm / 2, edge_mm / 2, edge_mm / 2 - radius_mm);

Vector3d bent(const Vector3d& X) {
    const Vector3d up(X[0] - middle[0], X[1] - middle[1], radius_mm);
    return middle + (X[2] - middle[2]) * up.normalized();
}

double from_middle(const Vector3d& place) {
    return (place - middle).norm();
}

PreparedModel bent_layers() {
    meshing::TetMesh mesh = two_layers();
    for (auto node : mesh.nodes.colwise()) node = bent(node);
    imaging::Volume labels(plain_grid({40, 40, 30}, 2, {-20, -20, -12}), CV_32SC1);
    for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d place = labels.geometry.point(index), up = (place - middle) / (place - middle)[2] * radius_mm;
        const Vector3d X = middle + Vector3d(up[0], up[1], from_middle(place));
        const bool in = (X.array() > 0).all() && (X.array() < edge_mm).all();
        labels.data<std::int32_t>()[n] = !in ? 0 : X[2] < edge_mm / 2 ? lower : upper;
    });
    PrepareOptions options;
    options.sliding = {{lower, upper}};
    return prepare(std::move(mesh), labels, options);
}

/// Normals of nodes at the rim lean.
bool leans(const PreparedModel& prepared, const tled::SlidingPair& pair) {
    const Vector3d X = prepared.model.mesh.nodes.col(pair.first) - middle;
    return X.head<2>().cwiseAbs().maxCoeff() > edge_mm / 3;
}

/// The upper half turns about the middle of the sphere, along the lower one.
Vector3d turned(const Vector3d& place) {
    if (from_middle(place) < radius_mm) return place;
    return middle + Eigen::AngleAxisd(slid_mm / radius_mm, Vector3d::UnitX()) * (place - middle);
}

TEST(SlidingLabels, HaveInterfacesOfTheirOwn) {
    const PreparedModel glued = prepared_with({}), slides = prepared_with({{lower, upper}});
    EXPECT_TRUE(glued.sliding.empty());
    EXPECT_EQ(slides.sliding.size(), 49u) << "all nodes between the halves";
    EXPECT_EQ(slides.rest.node_count, glued.rest.node_count + 49);
    EXPECT_EQ(slides.interfaces.outer_faces().size(), glued.interfaces.outer_faces().size());
    const auto thickness = slides.interfaces.thickness(slides.model.mesh);
    for (const auto& [label, mm] : glued.interfaces.thickness(glued.model.mesh))
        EXPECT_NEAR(thickness.at(label), mm, 1e-9) << label;
    int sides = 0;
    for (const InterfaceNode& node : slides.interfaces.nodes()) {
        if (!node.slides) continue;
        ++sides;
        EXPECT_EQ(node.inner + node.outer, lower + upper);
        EXPECT_NEAR(node.normal[2], node.inner == lower ? 1 : -1, 1e-9) << "from inner to outer";
        const Vector3d X = slides.model.mesh.nodes.col(node.node);
        const bool within = (X.head(2).array() > 1).all() && (X.head(2).array() < edge_mm - 1).all();
        if (within) {
            EXPECT_NEAR(node.offset, 0, 0.1);
        }
    }
    EXPECT_EQ(sides, 2 * 49);
}

TEST(SlidingLabels, SlideWherePairsSaySo) {
    const UpdateResult glued = registered(prepared_with({})), slid = registered(prepared_with({{lower, upper}}));
    EXPECT_LT(error_beside_it(slid), 0.3);
    EXPECT_GT(error_beside_it(glued), 1.5) << "that tissue is torn or stays behind";
}

TEST(SlidingLabels, NeitherOpenNorEnterOneAnother) {
    const PreparedModel prepared = prepared_with({{lower, upper}});
    const UpdateResult result = registered(prepared);
    for (const tled::SlidingPair& pair : prepared.sliding) {
        const Vector3d apart =
            result.deformation.displacement.col(pair.first) - result.deformation.displacement.col(pair.second);
        EXPECT_NEAR(pair.normal.dot(apart), 0, 0.1)
            << "each lies on another place of the other, which is not quite flat";
        EXPECT_NEAR(apart.norm(), slid_mm, 1);
    }
}

// Slid by s along a sphere, nodes that were at one place differ in height by s²/2R; both surfaces touch as before.
TEST(SlidingLabels, RestWhereTheirSurfacesAreByThen) {
    const PreparedModel prepared = bent_layers();
    Matrix3Xd displacement = Matrix3Xd::Zero(3, prepared.rest.node_count);
    for (const tled::SlidingPair& pair : prepared.sliding) {
        const Vector3d X = prepared.model.mesh.nodes.col(pair.second);
        displacement.col(pair.second) =
            middle + Eigen::AngleAxisd(slid_mm / radius_mm, Vector3d::UnitX()) * (X - middle) - X;
    }
    const Matrix3Xd forces = detail::SlidSurfaces(prepared).forces(displacement);
    ASSERT_EQ(forces.cols(), displacement.cols());
    EXPECT_LT(forces.rowwise().sum().norm(), 1e-9) << "each presses on the other";
    for (const tled::SlidingPair& pair : prepared.sliding) {
        const double rests_at = pair.normal.dot(forces.col(pair.first)) / pair.stiffness,
                     lies_at = pair.normal.dot(displacement.col(pair.first) - displacement.col(pair.second));
        EXPECT_NEAR(rests_at, lies_at, 0.06);
        if (!leans(prepared, pair)) {
            EXPECT_GT(lies_at, 0.2);
        }
    }
    EXPECT_EQ(detail::SlidSurfaces(prepared_with({})).forces(displacement).cols(), 0);
    const PreparedModel flat = prepared_with({{lower, upper}});
    EXPECT_LT(detail::SlidSurfaces(flat).forces(Matrix3Xd::Zero(3, flat.rest.node_count)).norm(), 1e-9) << "at rest";
}

TEST(SlidingLabels, StayTogetherOnARoundSurface) {
    const PreparedModel prepared = bent_layers();
    Intraoperative seen;
    seen.points = pairs();
    for (Eigen::Index n = 0; n < seen.points->moving.cols(); ++n) {
        seen.points->moving.col(n) = bent(seen.points->moving.col(n));
        seen.points->fixed.col(n) = turned(seen.points->moving.col(n));
    }
    const UpdateResult result = update(prepared, seen, where_headers_have_it());
    const Matrix3Xd nodes = result.deformation.deformed_nodes();
    double entered = 0;
    int within = 0;
    for (const tled::SlidingPair& pair : prepared.sliding) {
        if (leans(prepared, pair)) continue;
        ++within;
        entered += from_middle(nodes.col(pair.first)) - from_middle(nodes.col(pair.second));
    }
    ASSERT_GT(within, 20);
    EXPECT_NEAR(entered / within, 0, 0.06) << "0.27 mm, nine tenths of s²/2R, where they keep the heights of rest";
}

/// 3 × N: the tissue of the upper half went along x, nodes that both halves share did not.
Matrix3Xd gone_apart(const PreparedModel& prepared) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    Matrix3Xd result = Matrix3Xd::Zero(3, mesh.nodes.cols());
    for (int t = 0; t < mesh.tet_count(); ++t)
        if (mesh.labels[t] == upper)
            for (const int node : mesh.tets.col(t)) result(0, node) = slid_mm;
    return result;
}

TEST(SlidingLabels, AreCarriedToAnotherMeshSideBySide) {
    const PreparedModel prepared = prepared_with({{lower, upper}});
    const Matrix3Xd gone = gone_apart(prepared);
    const Eigen::MatrixXd carried = detail::carried(prepared, gone, prepared);
    LastPulls pulls;
    for (const tled::SlidingPair& pair : prepared.sliding)
        for (const int node : {pair.first, pair.second})
            pulls.springs.push_back({{node, Eigen::Matrix3d::Identity(), gone.col(node)}, Origin::Datum});
    for (const bool labels : {false, true}) {
        if (labels) pulls.springs.push_back({{0, Eigen::Matrix3d::Identity(), Vector3d::Zero()}, Origin::Hold});
        const std::vector<tled::Spring> springs = detail::pulls_on(prepared, prepared, pulls).of(Origin::Datum);
        int at_surface = 0;
        for (const tled::Spring& spring : springs) {
            const auto is_there = [&](const tled::SlidingPair& pair) {
                return pair.first == spring.node || pair.second == spring.node;
            };
            if (std::none_of(prepared.sliding.begin(), prepared.sliding.end(), is_there)) continue;
            if (labels && spring.stiffness.trace() == 0) continue;
            ++at_surface;
            EXPECT_NEAR(spring.target[0], gone(0, spring.node), 1e-9) << labels << ", node " << spring.node;
        }
        EXPECT_GE(at_surface, 98);
    }
    for (const tled::SlidingPair& pair : prepared.sliding)
        for (const int node : {pair.first, pair.second}) EXPECT_NEAR(carried(0, node), gone(0, node), 1e-9);
}

TEST(SlidingLabels, MayHaveSlidFartherThanWasFound) {
    const PreparedModel prepared = prepared_with({{lower, upper}});
    const Eigen::MatrixXd slips = detail::slip_motions(prepared, gone_apart(prepared));
    ASSERT_EQ(slips.cols(), 3) << "two shifts and a turn";
    for (int k = 0; k < 3; ++k) {
        double squared = 0;
        for (const tled::SlidingPair& pair : prepared.sliding) {
            EXPECT_NEAR(slips(3 * pair.first + 2, k), 0, 1e-6);
            EXPECT_EQ(slips.col(k).segment<3>(3 * pair.second).norm(), 0) << "the first part moves, the other one not";
            squared += pair.stiffness * slips.col(k).segment<3>(3 * pair.first).squaredNorm();
        }
        double weights = 0;
        for (const tled::SlidingPair& pair : prepared.sliding) weights += pair.stiffness;
        EXPECT_NEAR(std::sqrt(squared / weights), detail::slip_model.of_slip * slid_mm, 0.05);
    }
    EXPECT_EQ(detail::slip_motions(prepared_with({}), gone_apart(prepared_with({}))).cols(), 0);
}

// Where the upper half is gone from the lower one's edge the outside lies, and beyond the other edge nothing below it.
TEST(SlidingLabels, FindWhatLiesBesideThemByThen) {
    const PreparedModel prepared = prepared_with({{lower, upper}});
    constexpr double far_mm = 10;
    const imaging::Volume before = layer_labels();
    imaging::Volume fixed(before.geometry, CV_32SC1);
    for_each_voxel(fixed, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d place = fixed.geometry.point(index), from = place - far_mm * Vector3d::UnitX();
        const auto within = [](const Vector3d& X) { return (X.array() > 0).all() && (X.array() < edge_mm).all(); };
        const bool is_upper = place[2] > edge_mm / 2;
        fixed.data<std::int32_t>()[n] = is_upper ? (within(from) ? upper : 0) : within(place) ? lower : 0;
    });
    Intraoperative seen;
    seen.labels = fixed;
    const UpdateResult result = update(prepared, seen, where_headers_have_it());
    std::vector<int> pulled;
    for (const tled::Spring& spring : result.pulls.of(Origin::Datum))
        if (spring.stiffness(2, 2) > 0) pulled.push_back(spring.node);
    const auto near = [](double a, double b) { return std::abs(a - b) < 1; };
    int alone = 0;
    for (const tled::SlidingPair& pair : prepared.sliding) {
        const Vector3d X = prepared.model.mesh.nodes.col(pair.first);
        if (X[1] < 5 || X[1] > edge_mm - 5) continue;  // edges show no boundary
        const bool uncovered = near(X[0], edge_mm / 6), over_nothing = near(X[0], edge_mm * 5 / 6);
        if (!uncovered && !over_nothing) continue;
        ++alone;
        EXPECT_THAT(pulled, Contains(uncovered ? pair.first : pair.second)) << X.transpose();
    }
    EXPECT_EQ(alone, 10);
    const auto held_out = uncertainty(prepared, result).held_out();
    ASSERT_TRUE(held_out);
    EXPECT_LT(held_out->z, held_out_doubt_limits.most_z) << "what slid is no contradiction";
}

TEST(SlidingLabels, ErrorsAreEstimatedOfEachSide) {
    const PreparedModel prepared = prepared_with({{lower, upper}});
    const UpdateResult result = registered(prepared);
    const Uncertainty estimate = uncertainty(prepared, result);
    const auto beside = estimate.at(Vector3d(20, 20, edge_mm / 2 + 1));
    ASSERT_EQ(beside.size(), 1u);
    ASSERT_TRUE(beside[0]);
    EXPECT_LT(beside[0]->interval_mm, 2);
}

TEST(SlidingLabels, ComeBackFromAFile) {
    const TemporaryFolder folder;
    const PreparedModel prepared = prepared_with({{lower, upper}});
    write_prepared(prepared, folder / "a.h5");
    const PreparedModel back = read_prepared(folder / "a.h5");
    EXPECT_EQ(back.options.sliding, prepared.options.sliding);
    EXPECT_EQ(back.model.mesh.nodes, prepared.model.mesh.nodes);
    EXPECT_EQ(back.model.mesh.tets, prepared.model.mesh.tets);
    ASSERT_EQ(back.sliding.size(), prepared.sliding.size());
    EXPECT_EQ(registered(back).deformation.displacement, registered(prepared).deformation.displacement);
}

TEST(SlidingLabels, ThatCannotSlideAreRefused) {
    const auto refusal = [](std::array<int, 2> labels, const char* words) {
        EXPECT_THAT([&] { prepared_with({labels}); }, ThrowsMessage<InvalidInput>(HasSubstr(words))) << words;
    };
    refusal({lower, lower}, "cannot slide on one another");
    refusal({lower, 7}, "7");
    PrepareOptions options;
    options.sliding = {{lower, upper}};
    options.rigid_neighbours = {upper};
    EXPECT_THAT([&] { prepare(two_layers(), layer_labels(), options); },
                ThrowsMessage<InvalidInput>(HasSubstr("along rigid neighbours it slides anyway")));
}

}  // namespace
}  // namespace tissuewarp::registration
