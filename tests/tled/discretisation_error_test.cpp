// The estimated error of linear tetrahedra: its matrices against those of quadratic tetrahedra, its numbers against
// their solution.

#include "tled/error/discretisation_error.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tled/error/hierarchical_product.hpp"
#include "tled/material/constitutive.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/reference/newton.hpp"
#include "tled/reference/quadratic.hpp"
#include "tled/stiffness/stiffness.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

// A jittered box of 20 × 20 × 15 mm with two labels.
meshing::TetMesh two_labels(int cells) {
    meshing::TetMesh mesh = meshing::box_mesh({20.0, 20.0, 15.0}, {cells, cells, cells}, 0.1, 7);
    for (int t = 0; t < mesh.tet_count(); ++t) mesh.labels[t] = t < mesh.tet_count() / 2 ? 1 : 2;
    return mesh;
}

Matrix3Xd wavy(const Matrix3Xd& X) {
    Matrix3Xd u(3, X.cols());
    for (int i = 0; i < X.cols(); ++i) {
        u.col(i) << std::sin(0.11 * X(1, i) + 0.05 * X(2, i)), 0.8 * std::cos(0.13 * X(0, i)),
            0.7 * std::sin(0.1 * X(0, i));
    }
    return u;
}

Model model_of(meshing::TetMesh mesh, const MaterialTable& materials) {
    Model model;
    model.mesh = std::move(mesh);
    model.materials = materials;
    model.element = suggested_element(materials);
    return model;
}

const MaterialTable soft{{1, neo_hookean_iso(3.0, 0.4)}, {2, neo_hookean_lnj(6.0, 0.3)}};
const MaterialTable stiff_in_volume{{1, neo_hookean_iso(3.0, 0.475)}, {2, neo_hookean_lnj(6.0, 0.47)}};

/// The hierarchical space of a mesh beside quadratic tetrahedra on it.
struct Twins {
    Twins(const MaterialTable& table, bool averaged)
        : mesh(two_labels(2)),
          quadratic(quadratic_mesh(mesh)),
          elements(quadratic, table,
                   {.pressure = averaged ? QuadraticPressure::NodalAverage : QuadraticPressure::Pointwise}),
          materials(table),
          averages(rest.materials.size(), averaged) {
        for (int k = 0; k < space.edge_count(); ++k) {
            middle.push_back(quadratic.middle.at({space.edge(0, k), space.edge(1, k)}));
        }
    }

    static RestState averaged_rest(const meshing::TetMesh& mesh, const MaterialTable& table) {
        Model model = model_of(mesh, table);
        model.element = Element::AveragedPressureT4;
        return rest_state(model);
    }

    [[nodiscard]] detail::HierarchicalTissue tissue(const Matrix3Xd& u, detail::Moduli moduli) const {
        return hierarchical_tissue(space, rest, averages, u, moduli);
    }
    // Displacements of corners and middles.
    [[nodiscard]] Matrix3Xd nodal(const Matrix3Xd& x) const {
        Matrix3Xd result(3, quadratic.node_count());
        result.leftCols(space.corner_count) = x.leftCols(space.corner_count);
        for (int k = 0; k < space.edge_count(); ++k) {
            result.col(middle[k]) =
                0.5 * (x.col(space.edge(0, k)) + x.col(space.edge(1, k))) + x.col(space.corner_count + k);
        }
        return result;
    }
    // Forces on hat functions and bubbles for those on corners and middles.
    [[nodiscard]] Matrix3Xd hierarchical(const Matrix3Xd& f) const {
        Matrix3Xd result(3, space.size());
        result.leftCols(space.corner_count) = f.leftCols(space.corner_count);
        for (int k = 0; k < space.edge_count(); ++k) {
            result.col(space.corner_count + k) = f.col(middle[k]);
            for (const int end : space.edge.col(k)) result.col(end) += 0.5 * f.col(middle[k]);
        }
        return result;
    }
    // Dense, of the twin.
    [[nodiscard]] Eigen::MatrixXd stiffness(const Matrix3Xd& u) const {
        Matrix3Xd linear = Matrix3Xd::Zero(3, space.size());
        linear.leftCols(space.corner_count) = u;
        std::vector<int> all(static_cast<std::size_t>(3 * quadratic.node_count()));
        std::iota(all.begin(), all.end(), 0);
        const Eigen::MatrixXd lower =
            detail::scalar_matrix(elements.stiffness(nodal(linear)), all, detail::Triangle::Lower);
        const Eigen::MatrixXd K = lower.selfadjointView<Eigen::Lower>();
        Eigen::MatrixXd result(3 * space.size(), 3 * space.size());
        for (Eigen::Index d = 0; d < result.cols(); ++d) {
            Matrix3Xd unit = Matrix3Xd::Zero(3, space.size());
            unit.reshaped()[d] = 1.0;
            const Eigen::VectorXd force = K * nodal(unit).reshaped();
            result.col(d) = hierarchical(force.reshaped(3, quadratic.node_count())).reshaped();
        }
        return result;
    }

    meshing::TetMesh mesh;
    QuadraticMesh quadratic;
    QuadraticTetrahedra elements;
    MaterialTable materials;
    RestState rest = averaged_rest(mesh, materials);
    detail::HierarchicalSpace space = detail::hierarchical_space(rest.nodes, rest.node_count);
    std::vector<bool> averages;
    std::vector<int> middle;  // node of every edge
};

Eigen::MatrixXd dense(const detail::HierarchicalProduct& product, int size) {
    Eigen::MatrixXd result(3 * size, 3 * size);
    for (Eigen::Index d = 0; d < result.cols(); ++d) {
        Matrix3Xd unit = Matrix3Xd::Zero(3, size);
        unit.reshaped()[d] = 1.0;
        result.col(d) = product(unit).reshaped();
    }
    return result;
}

void expect_same_matrix(const Twins& twins, const Matrix3Xd& u) {
    const detail::HierarchicalTissue tissue = twins.tissue(u, detail::Moduli::Exact);
    const Eigen::MatrixXd expected = twins.stiffness(u);
    const Eigen::MatrixXd found = dense(detail::HierarchicalProduct(tissue), twins.space.size());
    EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 2e-6 * expected.cwiseAbs().maxCoeff());
    const std::vector<Eigen::Matrix3d> blocks = bubble_blocks(tissue);
    for (int k = 0; k < twins.space.edge_count(); ++k) {
        const int d = 3 * (twins.space.corner_count + k);
        EXPECT_LT((blocks[k] - expected.block<3, 3>(d, d)).cwiseAbs().maxCoeff(),
                  1e-9 * expected.cwiseAbs().maxCoeff());
    }
}

// A wrong factor of any integral, or a wrong edge, changes entries by a part of themselves.
TEST(DiscretisationError, StiffnessIsThatOfQuadraticTetrahedra) {
    const Twins twins(soft, false);
    expect_same_matrix(twins, wavy(twins.mesh.nodes));
}

// Under uniform pressures, as the tangent takes their mean in every element.
TEST(DiscretisationError, StiffnessWithAveragesIsThatOfQuadraticTetrahedra) {
    const Twins twins(stiff_in_volume, true);
    expect_same_matrix(twins, Matrix3Xd::Zero(3, twins.mesh.node_count()));
    const Eigen::Matrix3d H{{0.1, 0.22, -0.08}, {-0.05, -0.07, 0.17}, {0.12, -0.1, 0.06}};
    expect_same_matrix(twins, H * twins.mesh.nodes);
}

// At the corners, what plain linear elements bear more.
TEST(DiscretisationError, ResidualIsThatOfQuadraticTetrahedra) {
    for (const bool averaged : {false, true}) {
        const Twins twins(averaged ? stiff_in_volume : soft, averaged);
        const Matrix3Xd u = wavy(twins.mesh.nodes);
        Matrix3Xd linear = Matrix3Xd::Zero(3, twins.space.size());
        linear.leftCols(twins.space.corner_count) = u;
        Matrix3Xd expected = -twins.hierarchical(twins.elements.force(twins.nodal(linear)));
        const double scale = expected.cwiseAbs().maxCoeff();
        Model plain = model_of(twins.mesh, twins.materials);
        plain.element = Element::T4;
        const RestState rest = rest_state(plain);
        expected.leftCols(twins.space.corner_count) += internal_force(rest, u);

        const Eigen::VectorXd J = jacobians(rest, u);
        Eigen::VectorXd pressure(J.size());
        for (int e = 0; e < J.size(); ++e) {
            const int tet = twins.rest.tet[e];
            const Material& material = twins.materials.at(twins.mesh.labels[tet]);
            pressure[e] = volumetric_modulus(material) * volumetric_function(material, J[tet]).first;
        }
        const Matrix3Xd found = residual(twins.tissue(u, detail::Moduli::Exact), pressure);
        EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-9 * scale);
    }
}

TEST(DiscretisationError, PositivePartOfPressedTissueIsPositive) {
    const Twins twins(soft, false);
    Matrix3Xd u = Matrix3Xd::Zero(3, twins.mesh.node_count());
    u.row(2) = -0.5 * twins.mesh.nodes.row(2);
    const auto lowest = [&](detail::Moduli moduli) {
        const Eigen::MatrixXd K = dense(detail::HierarchicalProduct(twins.tissue(u, moduli)), twins.space.size());
        return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(K).eigenvalues()[0] / K.cwiseAbs().maxCoeff();
    };
    EXPECT_LT(lowest(detail::Moduli::Exact), -1e-3);
    EXPECT_GT(lowest(detail::Moduli::PositivePart), -1e-5);
}

/// A box held below, under its weight and a traction on its top, so small that all is nearly linear (0.1 %).
struct Loaded {
    explicit Loaded(const MaterialTable& materials, int cells = 3) : model(model_of(two_labels(cells), materials)) {
        loads.body_force = {0.0, 1e-4, -2e-4};
        for (const meshing::InterfaceFace& face : meshing::interface_faces(model.mesh)) {
            const auto on_top = [&](int node) { return model.mesh.nodes(2, node) > 15.0 - 1e-9; };
            if (on_top(face.nodes[0]) && on_top(face.nodes[1]) && on_top(face.nodes[2])) {
                loads.tractions.push_back({face.nodes, {3e-3, 0.0, 1e-3}});
            }
        }
        quadratic_load = body_load(quadratic, loads.body_force);
        for (const FaceTraction& each : loads.tractions) {
            add_traction(quadratic, each.corners, each.traction, quadratic_load);
        }
        load = quadratic_load.leftCols(model.mesh.node_count());
        for (const auto& [edge, middle] : quadratic.middle) {
            load.col(edge.first) += 0.5 * quadratic_load.col(middle);
            load.col(edge.second) += 0.5 * quadratic_load.col(middle);
        }
    }

    [[nodiscard]] static NodalConditions held_below(const Matrix3Xd& nodes, const Matrix3Xd& force) {
        Conditions conditions;
        conditions.external_force = force;
        for (int i = 0; i < nodes.cols(); ++i) {
            if (nodes(2, i) < 1e-9) conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
        }
        return nodal_conditions(conditions, static_cast<int>(nodes.cols()));
    }
    [[nodiscard]] DiscretisationEstimate estimate(const DiscretisationOptions& options = {}) const {
        const NodalConditions conditions = held_below(model.mesh.nodes, load);
        const RestState rest = rest_state(model);
        return discretisation_error(model, RestStiffness(rest, conditions), conditions, linear_solution(), loads,
                                    options);
    }
    [[nodiscard]] Matrix3Xd linear_solution() const {
        return newton_equilibrium(rest_state(model), held_below(model.mesh.nodes, load), newton).displacement;
    }
    [[nodiscard]] Matrix3Xd quadratic_solution(QuadraticPressure pressure) const {
        const QuadraticTetrahedra elements(quadratic, model.materials, {.pressure = pressure});
        return newton_equilibrium(elements, held_below(quadratic.nodes, quadratic_load), newton).displacement;
    }

    NewtonOptions newton{.tolerance_mm = 1e-7};
    Model model;
    QuadraticMesh quadratic = quadratic_mesh(model.mesh);
    DistributedLoads loads;
    Matrix3Xd quadratic_load, load;  // consistent, mN
};

// Under small loads the estimate takes linear to quadratic tetrahedra, corners and middles, whatever the linear ones
// do with the pressure.
TEST(DiscretisationError, IsTheDifferenceToQuadraticTetrahedra) {
    for (const bool averaged : {false, true}) {
        for (const Element element : {Element::T4, Element::AveragedPressureT4}) {
            Loaded problem(averaged ? stiff_in_volume : soft);
            problem.model.element = element;
            const Matrix3Xd linear = problem.linear_solution();
            const Matrix3Xd quadratic =
                problem.quadratic_solution(averaged ? QuadraticPressure::NodalAverage : QuadraticPressure::Pointwise);
            const DiscretisationEstimate found = problem.estimate({.relative_tolerance = 1e-6});
            ASSERT_TRUE(found.error) << found.reason;
            const int corners = problem.model.mesh.node_count();
            const Matrix3Xd expected = quadratic.leftCols(corners) - linear;
            EXPECT_LT((found.error->corner - expected).norm(), 0.01 * expected.norm());
            EXPECT_GT(expected.norm(), 0.02 * linear.norm());
            for (Eigen::Index k = 0; k < found.error->edge.cols(); ++k) {
                const int a = found.error->edge(0, k), b = found.error->edge(1, k);
                const Vector3d bubble =
                    quadratic.col(problem.quadratic.middle.at({a, b})) - 0.5 * (quadratic.col(a) + quadratic.col(b));
                EXPECT_LT((found.error->bubble.col(k) - bubble).norm(), 0.01 * found.error->bubble.norm());
            }
        }
    }
}

// Although its tangent stiffness takes them for softer in volume.
TEST(DiscretisationError, IsNearlyTheDifferenceAtHigherPoissonsRatios) {
    for (const double nu : {0.49, 0.4999}) {
        for (const Element element : {Element::T4, Element::AveragedPressureT4}) {
            Loaded problem({{1, neo_hookean_iso(3.0, nu)}, {2, neo_hookean_lnj(6.0, nu)}});
            problem.model.element = element;
            const Matrix3Xd expected =
                problem.quadratic_solution(QuadraticPressure::NodalAverage).leftCols(problem.model.mesh.node_count()) -
                problem.linear_solution();
            const DiscretisationEstimate found = problem.estimate();
            ASSERT_TRUE(found.error) << found.reason;
            EXPECT_LT((found.error->corner - expected).norm(), 0.2 * expected.norm()) << nu;
        }
    }
}

TEST(DiscretisationError, DefaultToleranceIsEnough) {
    const Loaded problem(stiff_in_volume);
    const auto exact = problem.estimate({.relative_tolerance = 1e-6}), usual = problem.estimate();
    EXPECT_LT((usual.error->corner - exact.error->corner).norm(), 0.05 * exact.error->corner.norm());
    EXPECT_LT(usual.error->iterations, 40);
}

TEST(DiscretisationError, AHomogeneousStateHasNone) {
    const Model model = model_of(two_labels(3), {{1, neo_hookean_iso(3.0, 0.45)}, {2, neo_hookean_iso(3.0, 0.45)}});
    const Eigen::Matrix3d H{{0.1, 0.22, -0.08}, {-0.05, -0.07, 0.17}, {0.12, -0.1, 0.06}};
    Conditions held;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(model.mesh)) {
        for (const int node : face.nodes) {
            const bool seen = std::any_of(held.prescribed.begin(), held.prescribed.end(),
                                          [node](const PrescribedDisplacement& each) { return each.node == node; });
            if (face.outer == 0 && !seen) {
                held.prescribed.push_back({node, {true, true, true}, H * model.mesh.nodes.col(node)});
            }
        }
    }
    const NodalConditions conditions = nodal_conditions(held, model.mesh.node_count());
    const DiscretisationEstimate found =
        discretisation_error(model, RestStiffness(rest_state(model), conditions), conditions, H * model.mesh.nodes);
    ASSERT_TRUE(found.error) << found.reason;
    EXPECT_LT(found.error->corner.cwiseAbs().maxCoeff(), 1e-9);  // mm
    EXPECT_LT(found.error->bubble.cwiseAbs().maxCoeff(), 1e-9);
}

// Springs on a face hold it between the nodes too: as they stiffen, they do what prescribed displacements do. Springs
// of the nodes alone would leave bubbles on the face free.
TEST(DiscretisationError, StiffSpringsHoldTheFaceBetweenTheNodes) {
    const Loaded problem(soft);
    const RestState rest = rest_state(problem.model);
    Conditions sprung;
    sprung.external_force = problem.load;
    for (int i = 0; i < problem.model.mesh.node_count(); ++i) {
        if (problem.model.mesh.nodes(2, i) < 1e-9) {
            sprung.springs.push_back({i, 1e4 * Eigen::Matrix3d::Identity(), Vector3d::Zero()});
        }
    }
    const NodalConditions conditions = nodal_conditions(sprung, problem.model.mesh.node_count());
    const Matrix3Xd u = newton_equilibrium(rest, conditions, problem.newton).displacement;
    const DiscretisationEstimate found = discretisation_error(problem.model, RestStiffness(rest, conditions),
                                                              conditions, u, problem.loads),
                                 held = problem.estimate();
    ASSERT_TRUE(found.error && held.error) << found.reason << held.reason;
    EXPECT_LT((found.error->corner - held.error->corner).norm(), 0.02 * held.error->corner.norm());
    EXPECT_LT((found.error->bubble - held.error->bubble).norm(), 0.02 * held.error->bubble.norm());
}

TEST(DiscretisationError, IsQuadraticInTetrahedra) {
    const Loaded problem(soft);
    const DiscretisationError error = *problem.estimate().error;
    const meshing::TetMesh& mesh = problem.model.mesh;
    for (const int tet : {0, 17, mesh.tet_count() - 1}) {
        Eigen::Matrix<double, 3, 10> nodal;
        for (int c = 0; c < 4; ++c) nodal.col(c) = error.corner.col(mesh.tets(c, tet));
        for (int k = 0; k < 6; ++k) {
            const auto [a, b] = detail::tetrahedron_edges[k];
            nodal.col(4 + k) = 0.5 * (nodal.col(a) + nodal.col(b)) + error.bubble.col(error.edges_of(k, tet));
        }
        const Vector3d local(0.2, 0.35, 0.15);
        const Eigen::Vector4d barycentric(0.3, 0.2, 0.35, 0.15);
        EXPECT_LT((error.at(mesh, tet, barycentric) - nodal * quadratic_shape(local)).norm(), 1e-12 * nodal.norm());
    }
}

TEST(DiscretisationError, HasTheSameBitsForAnyNumberOfThreads) {
    const Loaded problem(stiff_in_volume);
    const DiscretisationEstimate many = problem.estimate();
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const DiscretisationEstimate alone = problem.estimate();
    EXPECT_EQ(many.error->corner, alone.error->corner);
    EXPECT_EQ(many.error->bubble, alone.error->bubble);
}

TEST(DiscretisationError, SaysWhyThereIsNone) {
    const Loaded problem(soft);
    const RestState rest = rest_state(problem.model);
    const NodalConditions conditions = Loaded::held_below(problem.model.mesh.nodes, problem.load);
    const RestStiffness stiffness(rest, conditions);
    const auto reason = [&](const Matrix3Xd& u, const DiscretisationOptions& options = {}) {
        return discretisation_error(problem.model, stiffness, conditions, u, problem.loads, options).reason;
    };
    const Matrix3Xd u = problem.linear_solution();
    EXPECT_EQ(reason(u), "");
    EXPECT_THAT(reason(-2.0 * problem.model.mesh.nodes), testing::HasSubstr("det F"));
    EXPECT_THAT(reason(Matrix3Xd::Constant(3, u.cols(), NAN)), testing::HasSubstr("det F"));
    EXPECT_THAT(reason(u, {.max_iterations = 1}), testing::HasSubstr("did not converge"));
    EXPECT_THROW(static_cast<void>(reason(Matrix3Xd::Zero(3, 5))), InvalidInput);

    EXPECT_THROW(static_cast<void>(discretisation_error(problem.model, stiffness, conditions, u,
                                                        {.tractions = {{{0, 1, 100000}, Vector3d::UnitX()}}})),
                 InvalidInput);
    EXPECT_THAT(
        discretisation_error(problem.model, stiffness, conditions, u, {.body_force = Vector3d::Constant(NAN)}).reason,
        testing::HasSubstr("not finite"));
    Conditions one_free;
    for (int i = 1; i < u.cols(); ++i) {
        if (problem.model.mesh.nodes(2, i) < 1e-9) one_free.prescribed.push_back({i});
    }
    EXPECT_THROW(static_cast<void>(discretisation_error(problem.model, stiffness,
                                                        nodal_conditions(one_free, static_cast<int>(u.cols())), u)),
                 InvalidInput);

    Conditions pressed;
    for (int i = 0; i < u.cols(); ++i) {
        if (problem.model.mesh.nodes(2, i) < 1e-9) pressed.prescribed.push_back({i});
    }
    const std::array<int, 3>& face = problem.loads.tractions[0].corners;
    pressed.effects.pressures.push_back({.faces = Eigen::Vector3i(face[0], face[1], face[2]), .pressure = 0.1});
    EXPECT_THAT(discretisation_error(problem.model, stiffness, nodal_conditions(pressed, rest), u).reason,
                testing::HasSubstr("pressures"));
}

}  // namespace
}  // namespace tissuewarp::tled
