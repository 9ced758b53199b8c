// Meshes and conditions that are far away, in pieces, or broken.

#include "core/errors.hpp"
#include "tests/stability/hard_cases.hpp"

#include <gmock/gmock.h>

namespace tissuewarp::stability {
namespace {

using Input = OnEveryEngine;
INSTANTIATE_TEST_SUITE_P(All, Input, every_engine, engine_name);

const tled::Material soft = tled::neo_hookean_lnj(3.0, 0.45);

// Coordinates of 1 000 mm leave float32 6e-5 mm: an engine that computed with positions would lose the strains of small
// motions. A failure looks like: noise in the displacement field. Tolerance 1e-4 mm of 2 mm between near and far.
TEST_P(Input, AnOrganFarFromTheOriginMovesAsOneAtTheOrigin) {
    const tled::Model near = box({40, 40, 40}, {5, 5, 5}, soft);
    tled::Model far = near;
    far.mesh.nodes.colwise() += Vector3d(1000, -1000, 1000);
    const tled::RestState rest = tled::rest_state(near), far_rest = tled::rest_state(far);
    const Matrix3Xd u = solved(GetParam(), rest, between_plates(near, {0, 1, -2}), 0.01);
    const Matrix3Xd far_u = solved(GetParam(), far_rest, between_plates(far, {0, 1, -2}), 0.01);
    EXPECT_LT(distance(u, far_u), 0.011) << "two runs within tolerance of each other";
    const auto engine = make_engine(GetParam(), rest), far_engine = make_engine(GetParam(), far_rest);
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count), small = 1e-3 * tled::scene::wavy(near.mesh.nodes);
    engine->set_state(small, zero);
    far_engine->set_state(small, zero);
    const Matrix3Xd force = engine->internal_force();
    EXPECT_LT((far_engine->internal_force() - force).norm(), 2e-4 * force.norm());
}

/// Two boxes that do not touch.
tled::Model two_pieces() {
    tled::Model model = box({20, 20, 20}, {3, 3, 3}, soft);
    const tled::Model other = box({20, 20, 20}, {3, 3, 3}, soft);
    const int nodes = model.mesh.node_count(), tets = model.mesh.tet_count();
    model.mesh.nodes.conservativeResize(3, 2 * nodes);
    model.mesh.nodes.rightCols(nodes) = other.mesh.nodes.colwise() + Vector3d(50, 0, 0);
    model.mesh.tets.conservativeResize(4, 2 * tets);
    model.mesh.tets.rightCols(tets) = other.mesh.tets.array() + nodes;
    model.mesh.labels.conservativeResize(2 * tets);
    model.mesh.labels.tail(tets).setOnes();
    return model;
}

// Held pieces are solved side by side; a free one is named. A failure looks like: a piece that flies off, or a factor
// of a singular matrix that passes.
TEST_P(Input, DisconnectedPiecesAreSolvedWhenHeldAndNamedWhenFree) {
    const tled::Model model = two_pieces();
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions both = between_plates(model, {0, 0, -2});
    EXPECT_LT(distance(solved(GetParam(), rest, both, 0.01), by_newton(rest, both)), 0.02);
    const tled::NodalConditions one = held(model, [](const Vector3d& X) -> std::optional<Vector3d> {
        if (X.z() > 0 || X.x() > 30) return std::nullopt;
        return Vector3d::Zero();
    });
    EXPECT_THROW(tled::RestStiffness(rest, one), InvalidInput);
    EXPECT_THROW(by_newton(rest, one), InvalidInput);
}

// Springs along one axis leave two translations and the rotations. A failure looks like: an enormous displacement.
TEST(BadInput, FreeRigidModesAreNamed) {
    const tled::Model model = box({20, 20, 20}, {3, 3, 3}, soft);
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions along_x;
    Matrix3d K = Matrix3d::Zero();
    K(0, 0) = 10;
    for (int node = 0; node < 16; ++node) along_x.springs.push_back({node, K, {1, 0, 0}});
    EXPECT_THROW(tled::RestStiffness(rest, tled::nodal_conditions(along_x, rest.node_count)), InvalidInput);
    EXPECT_THROW(tled::RestStiffness(rest, tled::nodal_conditions({}, rest.node_count)), InvalidInput);
}

// A failure looks like: 1/0 in the shape-function derivatives, which poisons every node.
TEST(BadInput, TetrahedraWithoutVolumeAreRefused) {
    tled::Model flat = box({20, 20, 20}, {2, 2, 2}, soft);
    flat.mesh.nodes.col(13) = flat.mesh.nodes.col(4);  // the middle onto the middle of a face: coincident nodes
    EXPECT_THROW(tled::rest_state(flat), InvalidInput);
    tled::Model inside_out = box({20, 20, 20}, {2, 2, 2}, soft);
    std::swap(inside_out.mesh.tets(0, 5), inside_out.mesh.tets(1, 5));
    EXPECT_THROW(tled::rest_state(inside_out), InvalidInput);
    tled::Model twice = box({20, 20, 20}, {2, 2, 2}, soft);
    twice.mesh.tets(1, 5) = twice.mesh.tets(0, 5);  // the same node twice
    EXPECT_THROW(tled::rest_state(twice), InvalidInput);
}

// A failure looks like: a mass of zero, and a node that moves to infinity in the first step.
TEST(BadInput, NodesThatNoTetrahedronUsesAreRefused) {
    tled::Model model = box({20, 20, 20}, {2, 2, 2}, soft);
    model.mesh.nodes.conservativeResize(3, model.mesh.node_count() + 1);
    model.mesh.nodes.rightCols(1).setZero();
    EXPECT_THROW(tled::rest_state(model), InvalidInput);
}

TEST(BadInput, NumbersThatAreNotFiniteAreRefused) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    tled::Model model = box({20, 20, 20}, {2, 2, 2}, soft);
    model.mesh.nodes(1, 3) = nan;
    EXPECT_THROW(tled::rest_state(model), InvalidInput);
    tled::Conditions conditions;
    conditions.prescribed.push_back({0, {true, true, true}, {0, nan, 0}});
    EXPECT_THROW(tled::nodal_conditions(conditions, 27), InvalidInput);
}

// Two coincident sheets of nodes are a cut through the tissue: the halves part as the cut says. A failure looks like:
// halves that stick together, or a refusal of what is a valid mesh.
TEST_P(Input, DuplicateNodesAreACut) {
    tled::Model model = box({20, 20, 20}, {2, 2, 4}, soft);
    const int nodes = model.mesh.node_count(), layer = 9, first = 2 * layer;  // z = 10
    model.mesh.nodes.conservativeResize(3, nodes + layer);
    model.mesh.nodes.rightCols(layer) = model.mesh.nodes.middleCols(first, layer);
    for (int t = model.mesh.tet_count() / 2; t < model.mesh.tet_count(); ++t)
        for (int& node : model.mesh.tets.col(t))
            if (node >= first && node < first + layer) node += nodes - first;
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {0, 0, 3});
    const Matrix3Xd u = solved(GetParam(), rest, conditions, 0.01);
    EXPECT_LT(u.middleCols(first, layer).norm(), 0.02) << "the lower half stays";
    EXPECT_LT((u.rightCols(layer).colwise() - Vector3d(0, 0, 3)).norm(), 0.02) << "the upper half follows";
}

}  // namespace
}  // namespace tissuewarp::stability
