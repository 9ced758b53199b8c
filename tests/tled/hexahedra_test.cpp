/// The one-point hexahedron of the scalar reference, alone and beside tetrahedra.
#include "tests/tled/engine_scene.hpp"

#include "core/errors.hpp"
#include "meshing/hex_primitives.hpp"
#include "tled/equilibrium.hpp"
#include "tled/model/hexahedra.hpp"
#include "tled/reference/newton.hpp"
#include "tled/stiffness/rest_stiffness.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include <gmock/gmock.h>
#include <Eigen/Dense>

#include <cmath>

namespace tissuewarp::tled {
namespace {

using namespace scene;
using testing::HasSubstr;
using testing::ThrowsMessage;

enum class Scene { Hexahedra, MixedT4, MixedAveragedPressure };

bool is_inside(const Vector3d& X, const Vector3d& size) {
    return (X.array() > 1e-9).all() && (X.array() < size.array() - 1e-9).all();
}

// A jittered box of 3 × 2 × 2 cells and two materials; in mixed scenes hexahedra and tetrahedra meet in steps.
class Hexahedra : public testing::TestWithParam<Scene> {
protected:
    const Vector3d size{30.0, 20.0, 24.0};
    Model model = make_model(GetParam(), {3, 2, 2});
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;

    [[nodiscard]] Model make_model(Scene scene, const std::array<int, 3>& cells) const {
        const auto is_hexahedron = [&](int i, int j, int k) {
            return scene == Scene::Hexahedra || (i + j + k) % 3 != 1;
        };
        const meshing::MixedMesh box = meshing::mixed_box(size, cells, is_hexahedron, 0.12, 7);
        Model result;
        result.mesh = box.mesh;
        result.hexahedra = box.hexahedra;
        for (int h = 0; h < result.hexahedra.count(); ++h) result.hexahedra.labels[h] = 1 + h % 2;
        for (int t = 0; t < result.mesh.tet_count(); ++t) result.mesh.labels[t] = 1 + t / 6 % 2;
        result.materials = {{1, NeoHookeanLnJ{2.5, 30.0}}, {2, NeoHookeanIso{1.007, 20.0}}};
        result.element = scene == Scene::MixedT4 ? Element::T4 : Element::AveragedPressureT4;
        return result;
    }
};

INSTANTIATE_TEST_SUITE_P(Scenes, Hexahedra,
                         testing::Values(Scene::Hexahedra, Scene::MixedT4, Scene::MixedAveragedPressure),
                         [](const auto& each) {
                             return each.param == Scene::Hexahedra ? "Alone"
                                    : each.param == Scene::MixedT4 ? "MixedT4"
                                                                   : "MixedAveragedPressure";
                         });

TEST_P(Hexahedra, ForceIsTheGradientOfTheEnergy) {
    const Matrix3Xd u = wavy(X), force = internal_force(rest, u);
    const double step = 1e-4;  // mm
    for (int d = 0; d < u.size(); ++d) {
        Matrix3Xd up = u, down = u;
        up.data()[d] += step;
        down.data()[d] -= step;
        const double difference = (elastic_energy(rest, up) - elastic_energy(rest, down)) / (2 * step);
        EXPECT_NEAR(force.data()[d], difference, 1e-7 * largest(force)) << d;
    }
}

TEST_P(Hexahedra, StiffnessIsTheGradientOfTheForceAndSymmetric) {
    const Matrix3Xd u = wavy(X);
    const Eigen::MatrixXd K = tangent_stiffness(rest, u);
    const double step = 1e-4;  // mm
    EXPECT_LT((K - K.transpose()).norm(), 1e-14 * K.norm());
    for (int d = 0; d < u.size(); ++d) {
        Matrix3Xd up = u, down = u;
        up.data()[d] += step;
        down.data()[d] -= step;
        const Matrix3Xd difference = (internal_force(rest, up) - internal_force(rest, down)) / (2 * step);
        EXPECT_LT((difference.reshaped() - K.col(d)).cwiseAbs().maxCoeff(), 1e-7 * K.cwiseAbs().maxCoeff()) << d;
    }
}

TEST_P(Hexahedra, RigidMotionCostsNothing) {
    const Matrix3d R = Eigen::AngleAxisd(1.9, Vector3d(0.3, 1.0, -0.4).normalized()).toRotationMatrix();
    const Matrix3Xd u = ((R - Matrix3d::Identity()) * X).colwise() + Vector3d(5.0, -7.0, 11.0);
    EXPECT_NEAR(elastic_energy(rest, u), 0.0, 1e-9);  // mN mm
    EXPECT_LT(largest(internal_force(rest, u)), 1e-10);
    EXPECT_LT((jacobians(rest, u).array() - 1.0).abs().maxCoeff(), 1e-12);
}

TEST_P(Hexahedra, ForcesTurnWithTheTissueAndHaveNeitherSumNorMoment) {
    const Matrix3d R = Eigen::AngleAxisd(1.9, Vector3d(0.3, 1.0, -0.4).normalized()).toRotationMatrix();
    const Matrix3Xd u = wavy(X), turned = R * (X + u) - X, force = internal_force(rest, u);
    EXPECT_LT((internal_force(rest, turned) - R * force).norm(), 1e-11 * force.norm());
    Vector3d moment = Vector3d::Zero();
    for (int i = 0; i < u.cols(); ++i) moment += (X.col(i) + u.col(i)).cross(force.col(i));
    EXPECT_LT(force.rowwise().sum().norm(), 1e-12 * force.norm());
    EXPECT_LT(moment.norm(), 1e-11 * force.norm() * X.cwiseAbs().maxCoeff());
}

// The patch test, finite strain: homogeneous stress balances at every node inside, and the boundary carries it,
// although the hexahedra are no parallelepipeds and meet triangles.
TEST_P(Hexahedra, HomogeneousStrainIsInEquilibrium) {
    model.materials[1] = model.materials[2];
    rest = rest_state(model);
    const Matrix3d F{{1.15, 0.1, 0.0}, {0.05, 0.9, 0.08}, {0.02, -0.03, 1.05}};
    const Matrix3Xd u = (F - Matrix3d::Identity()) * X, force = internal_force(rest, u);
    const double volume = size.prod();
    EXPECT_NEAR(rest.volume.sum() + rest.hexahedra.volume.sum(), volume, 1e-11 * volume);
    EXPECT_NEAR(elastic_energy(rest, u), volume * strain_energy(model.materials[1], F), 1e-8);
    int inside = 0;
    for (int i = 0; i < X.cols(); ++i) {
        if (!is_inside(X.col(i), size)) continue;
        ++inside;
        EXPECT_LT(force.col(i).norm(), 1e-12 * force.norm()) << i;
    }
    EXPECT_GT(inside, 1);
    Vector3d face = Vector3d::Zero();  // virtual displacement x/L c gives c·P e_x area
    for (int i = 0; i < X.cols(); ++i) face += X(0, i) / size.x() * force.col(i);
    const Vector3d traction = first_piola_kirchhoff_stress(model.materials[1], F).col(0);
    EXPECT_LT((face / (size.y() * size.z()) - traction).norm(), 1e-12);
}

TEST_P(Hexahedra, NewtonFindsTheLinearSolutionOfAPatch) {
    model = make_model(GetParam(), {4, 3, 3});
    rest = rest_state(model);
    const Matrix3d H{{0.2, 0.1, 0.0}, {-0.1, 0.1, 0.2}, {0.1, 0.0, -0.1}};
    Conditions conditions;
    for (int i = 0; i < X.cols(); ++i) {
        if (!is_inside(X.col(i), size)) conditions.prescribed.push_back({i, {true, true, true}, H * X.col(i)});
    }
    model.materials[1] = model.materials[2];
    rest = rest_state(model);
    const NewtonResult found = newton_equilibrium(rest, nodal_conditions(conditions, rest.node_count));
    EXPECT_LT(largest(found.displacement - H * X), 1e-9);  // mm
}

TEST_P(Hexahedra, JacobiansAndMassFollowTheMesh) {
    const Matrix3d F{{1.15, 0.1, 0.0}, {0.05, 0.9, 0.08}, {0.02, -0.03, 1.05}};
    Matrix3Xd u = Matrix3Xd::Zero(3, X.cols());
    const int hex = 2;  // stretched alone, about its first node
    for (const int node : model.hexahedra.hexes.col(hex))
        u.col(node) = (F - Matrix3d::Identity()) * (X.col(node) - X.col(model.hexahedra.hexes(0, hex)));
    const Eigen::VectorXd J = jacobians(rest, u);
    ASSERT_EQ(J.size(), model.mesh.tet_count() + model.hexahedra.count());
    EXPECT_NEAR(J[model.mesh.tet_count() + hex], F.determinant(), 1e-12);
    EXPECT_NEAR(rest.lumped_mass.sum(), model.density * size.prod(), 1e-12);
}

TEST_P(Hexahedra, RestStiffnessSolvesForThem) {
    Conditions conditions;
    for (int i = 0; i < X.cols(); ++i)
        if (X(2, i) < 1e-9) conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
    conditions.external_force = wavy(X);
    const NodalConditions c = nodal_conditions(conditions, rest.node_count);
    const Matrix3Xd u = RestStiffness(rest, c).linear_solution(c);
    const Eigen::VectorXd Ku = tangent_stiffness(rest, Matrix3Xd::Zero(3, rest.node_count)) * u.reshaped();
    const Matrix3Xd residual = conditions.external_force - Ku.reshaped(3, rest.node_count);
    EXPECT_LT(largest(c.constrained.select(Matrix3Xd::Zero(3, rest.node_count), residual)), 1e-11 * largest(wavy(X)));
    EXPECT_THAT([&] { RestStiffness(rest, nodal_conditions({}, rest.node_count)); },
                ThrowsMessage<InvalidInput>(HasSubstr("nothing holds the tissue")));
}

TEST_P(Hexahedra, AnInvertedHexahedronIsNamed) {
    Matrix3Xd u = Matrix3Xd::Zero(3, X.cols());
    const Matrix3d mirror = Vector3d(-2, 0, 0).asDiagonal();
    for (const int node : model.hexahedra.hexes.col(3)) u.col(node) = mirror * (X.col(node) - X.col(0));
    EXPECT_TRUE(std::isinf(elastic_energy(rest, u)));
    if (GetParam() != Scene::Hexahedra) return;  // a tetrahedron beside it is named first
    const auto has_inverted = ThrowsMessage<SolverFailure>(HasSubstr("hexahedron"));
    EXPECT_THAT([&] { static_cast<void>(internal_force(rest, u)); }, has_inverted);
    EXPECT_THAT([&] { static_cast<void>(tangent_stiffness(rest, u)); }, has_inverted);
}

// Six zero eigenvalues, as rigid motions have them, and no other: neither of a brick nor of a distorted hexahedron.
TEST(Hexahedron, HasNoZeroEnergyModeButTheRigidMotions) {
    for (const double distortion : {0.0, 2.0}) {
        Model model;
        const meshing::MixedMesh box = meshing::box_hexes({10.0, 7.0, 12.0}, {1, 1, 1});
        model.mesh = box.mesh;
        model.hexahedra = box.hexahedra;
        model.mesh.nodes += distortion * wavy(3 * model.mesh.nodes);
        model.materials[1] = neo_hookean_iso(3.0, 0.49);
        const RestState rest = rest_state(model);
        const Eigen::MatrixXd K = tangent_stiffness(rest, Matrix3Xd::Zero(3, 8));
        const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(K).eigenvalues();
        EXPECT_LT(values.head(6).cwiseAbs().maxCoeff(), 1e-12 * values[23]);
        EXPECT_GT(values[6], 1e-2 * shear_modulus(model.materials[1]) * 7.0);  // mN/mm
    }
}

TEST(Hexahedron, HourglassVectorsAreOrthogonalToLinearDisplacementsAndTheEnginesFormOfThemIsTheSame) {
    Model model;
    const meshing::MixedMesh box = meshing::box_hexes({10.0, 7.0, 12.0}, {2, 2, 2}, 0.15, 3);
    model.mesh = box.mesh;
    model.hexahedra = box.hexahedra;
    model.materials[1] = neo_hookean_iso(3.0, 0.49);
    const HexState state = rest_state(model).hexahedra;
    for (int e = 0; e < state.count(); ++e) {
        const Eigen::Matrix<double, 8, 4> gamma = detail::hourglass_vectors(state, e);
        EXPECT_LT(gamma.colwise().sum().norm(), 1e-13);
        EXPECT_LT((meshing::hex_corners(model.mesh.nodes, model.hexahedra, e) * gamma).norm(), 1e-12);
        EXPECT_GT(gamma.colwise().norm().minCoeff(), 1.0);
    }
}

// A force on one node in the middle of a face: without control neighbours move in the checkerboard of an hourglass
// mode.
TEST(Hexahedron, HourglassControlKeepsAPointLoadedBlockRegular) {
    const auto hourglass_part = [](double coefficient) {
        Model model;
        const meshing::MixedMesh box = meshing::box_hexes({60.0, 60.0, 40.0}, {6, 6, 4});
        model.mesh = box.mesh;
        model.hexahedra = box.hexahedra;
        model.hourglass_coefficient = coefficient;
        model.materials[1] = neo_hookean_lnj(3.0, 0.49);
        const RestState rest = rest_state(model);
        Conditions conditions;
        conditions.external_force = Matrix3Xd::Zero(3, rest.node_count);
        for (int i = 0; i < rest.node_count; ++i) {
            const Vector3d X = model.mesh.nodes.col(i);
            if (X.z() < 1e-9) conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
            if ((X - Vector3d(30, 30, 40)).norm() < 1e-9) conditions.external_force(2, i) = -10;  // mN
        }
        const NodalConditions c = nodal_conditions(conditions, rest.node_count);
        const Matrix3Xd u = RestStiffness(rest, c).linear_solution(c);
        double largest_q = 0, largest_strain = 0;
        for (int e = 0; e < rest.hexahedra.count(); ++e) {
            Eigen::Matrix<double, 3, 8> corners;
            for (int k = 0; k < 8; ++k) corners.col(k) = u.col(rest.hexahedra.nodes(k, e));
            largest_q = std::max(largest_q, (corners * detail::hourglass_vectors(rest.hexahedra, e)).norm() / 8);
            const Matrix3d F = detail::hex_deformation_gradient(rest.hexahedra, u, e);
            largest_strain = std::max(largest_strain, (F - Matrix3d::Identity()).norm());
        }
        return largest_q / (10.0 * largest_strain);  // hourglass displacement over that of the strain in a cell
    };
    EXPECT_GT(hourglass_part(1e-4), 10.0);
    EXPECT_LT(hourglass_part(Model().hourglass_coefficient), 1.0);
}

// The cube of p1_cube_stretch: 6085.2 mN. Tetrahedra of averaged pressure are 5.1 % off with these nodes.
TEST(Hexahedron, StretchedCubeComesWithinTwoPerCentAndRelaxesToNewtonsState) {
    constexpr int cells = 8, layer = (cells + 1) * (cells + 1);
    Model model;
    const meshing::MixedMesh box = meshing::box_hexes({100.0, 100.0, 100.0}, {cells, cells, cells});
    model.mesh = box.mesh;
    model.hexahedra = box.hexahedra;
    model.materials[1] = NeoHookeanIso{1.007, 50.000333};
    const RestState rest = rest_state(model);
    Conditions conditions;
    for (int i = 0; i < layer; ++i) {
        conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
        conditions.prescribed.push_back({rest.node_count - layer + i, {true, true, true}, Vector3d(0, 0, 20)});
    }
    const NodalConditions c = nodal_conditions(conditions, rest.node_count);
    const Matrix3Xd u = newton_equilibrium(rest, c, {.tolerance_mm = 1e-6}).displacement;
    const double force = internal_force(rest, u).rightCols(layer).row(2).sum();
    EXPECT_NEAR(force, 6085.2, 0.02 * 6085.2);  // mN
    const std::unique_ptr<Engine> engine = make_cpu_engine(rest);
    const EquilibriumResult found = equilibrium(*engine, RestStiffness(rest, c), c);
    EXPECT_LT((found.displacement - u).colwise().norm().maxCoeff(), 0.02);  // mm
}

TEST(Hexahedron, WhatCannotBeSimulatedIsRefused) {
    Model model;
    const meshing::MixedMesh box = meshing::box_hexes({10.0, 7.0, 12.0}, {2, 1, 1});
    model.mesh = box.mesh;
    model.hexahedra = box.hexahedra;
    const auto refused = [&](const char* cause) { return ThrowsMessage<InvalidInput>(HasSubstr(cause)); };
    const auto prepare = [&] { rest_state(model); };
    EXPECT_THAT(prepare, refused("label 1 of the mesh has no material"));
    model.materials[1] = neo_hookean_iso(3.0, 0.49);
    EXPECT_NO_THROW(prepare());
    model.hourglass_coefficient = 0;
    EXPECT_THAT(prepare, refused("hourglass coefficient"));
    model.hourglass_coefficient = 0.04;
    model.hexahedra.hexes.row(0).swap(model.hexahedra.hexes.row(1));
    EXPECT_THAT(prepare, refused("hexahedron 0 has a scaled Jacobian"));
    model.hexahedra.hexes.row(0).swap(model.hexahedra.hexes.row(1));
    model.hexahedra.hexes(3, 1) = 99;
    EXPECT_THAT(prepare, refused("hexahedron 1 uses node 99"));
    model.hexahedra = {};
    EXPECT_THAT(prepare, refused("has no tetrahedra"));
}

}  // namespace
}  // namespace tissuewarp::tled
