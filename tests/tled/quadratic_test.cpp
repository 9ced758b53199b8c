#include "tled/reference/quadratic.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tled/material/constitutive.hpp"
#include "tled/reference/newton.hpp"
#include "tled/reference/quadrature.hpp"
#include "tled/stiffness/stiffness.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>
#include <numeric>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

double factorial(int n) {
    return n < 2 ? 1.0 : n * factorial(n - 1);
}

// ∫ x^a y^b z^c over the unit tetrahedron is a! b! c! / (a + b + c + 3)!.
TEST(Quadrature, RulesAreExactToTheirDegree) {
    const auto largest_error = [](Quadrature quadrature, int degree) {
        double error = 0.0;
        for (int a = 0; a <= degree; ++a) {
            for (int b = 0; a + b <= degree; ++b) {
                const int c = degree - a - b;
                double sum = 0.0;
                for (const detail::QuadraturePoint& p : detail::tetrahedron_rule(quadrature)) {
                    sum += p.weight * std::pow(p.local[0], a) * std::pow(p.local[1], b) * std::pow(p.local[2], c);
                }
                error =
                    std::max(error, std::abs(sum - factorial(a) * factorial(b) * factorial(c) / factorial(degree + 3)));
            }
        }
        return error;
    };
    const std::array<std::pair<Quadrature, int>, 3> rules{
        {{Quadrature::Points4, 2}, {Quadrature::Points5, 3}, {Quadrature::Points11, 4}}};
    for (const auto& [quadrature, degree] : rules) {
        for (int d = 0; d <= degree; ++d) EXPECT_LT(largest_error(quadrature, d), 1e-15);
        EXPECT_GT(largest_error(quadrature, degree + 1), 1e-7);
    }
}

// A small jittered box of two labels with one law each.
meshing::TetMesh two_labels() {
    meshing::TetMesh mesh = meshing::box_mesh({20.0, 20.0, 15.0}, {2, 2, 2}, 0.1, 7);
    for (int t = 0; t < mesh.tet_count(); ++t) mesh.labels[t] = t < mesh.tet_count() / 2 ? 1 : 2;
    return mesh;
}

// Moves middle nodes by up to 0.3 mm.
Vector3d bent(const Vector3d& a, const Vector3d& b) {
    const Vector3d middle = 0.5 * (a + b);
    return middle + 0.3 * Vector3d(std::sin(middle[1]), std::cos(middle[2]), std::sin(middle[0] + middle[1]));
}

const MaterialTable two_laws{{1, NeoHookeanIso{1.007, 20.0}}, {2, NeoHookeanLnJ{2.5, 30.0}}};

Matrix3Xd wavy(const Matrix3Xd& X) {
    Matrix3Xd u(3, X.cols());
    for (int i = 0; i < X.cols(); ++i) {
        u.col(i) << std::sin(0.11 * X(1, i) + 0.05 * X(2, i)), 0.8 * std::cos(0.13 * X(0, i)),
            0.7 * std::sin(0.1 * X(0, i));
    }
    return u;
}

class QuadraticTest : public testing::TestWithParam<QuadraticOptions> {
protected:
    // The rule of four points is not exact enough for a homogeneous state of curved elements.
    QuadraticMesh mesh =
        quadratic_mesh(two_labels(), GetParam().quadrature == Quadrature::Points4 ? EdgeCurve{} : EdgeCurve{bent});
    QuadraticTetrahedra elements{mesh, two_laws, GetParam()};
};

INSTANTIATE_TEST_SUITE_P(Options, QuadraticTest,
                         testing::Values(QuadraticOptions{Quadrature::Points4, QuadraticPressure::Pointwise},
                                         QuadraticOptions{Quadrature::Points5, QuadraticPressure::Pointwise},
                                         QuadraticOptions{Quadrature::Points11, QuadraticPressure::Pointwise},
                                         QuadraticOptions{Quadrature::Points4, QuadraticPressure::NodalAverage},
                                         QuadraticOptions{Quadrature::Points11, QuadraticPressure::NodalAverage}),
                         [](const auto& each) {
                             const int points =
                                 static_cast<int>(detail::tetrahedron_rule(each.param.quadrature).size());
                             return (each.param.pressure == QuadraticPressure::Pointwise ? "Pointwise"
                                                                                         : "NodalAverage") +
                                    std::to_string(points);
                         });

TEST_P(QuadraticTest, ForceIsTheGradientOfTheEnergy) {
    const Matrix3Xd u = wavy(mesh.nodes), force = elements.force(u);
    const double step = 1e-4;  // mm
    for (int d = 0; d < u.size(); ++d) {
        Matrix3Xd up = u, down = u;
        up.data()[d] += step;
        down.data()[d] -= step;
        const double difference = (elements.energy(up) - elements.energy(down)) / (2 * step);
        EXPECT_NEAR(force.data()[d], difference, 1e-7 * force.cwiseAbs().maxCoeff()) << d;
    }
}

TEST_P(QuadraticTest, StiffnessIsTheDerivativeOfTheForce) {
    const Matrix3Xd u = wavy(mesh.nodes);
    std::vector<int> all(static_cast<std::size_t>(u.size()));
    std::iota(all.begin(), all.end(), 0);
    const Eigen::SparseMatrix<double> lower =
        detail::scalar_matrix(elements.stiffness(u), all, detail::Triangle::Lower);
    const Eigen::MatrixXd K = Eigen::MatrixXd(lower).selfadjointView<Eigen::Lower>();
    const double step = 1e-4;  // mm
    for (int d = 0; d < u.size(); d += 7) {
        Matrix3Xd up = u, down = u;
        up.data()[d] += step;
        down.data()[d] -= step;
        const Eigen::VectorXd difference = (elements.force(up) - elements.force(down)).reshaped() / (2 * step);
        EXPECT_LT((K.col(d) - difference).cwiseAbs().maxCoeff(), 1e-7 * K.cwiseAbs().maxCoeff()) << d;
    }
}

// A homogeneous state, on curved elements too: the interior middles and corners find it.
TEST_P(QuadraticTest, HomogeneousStateIsFound) {
    const MaterialTable one_law{{1, NeoHookeanIso{1.007, 50.0}}, {2, NeoHookeanIso{1.007, 50.0}}};
    const QuadraticTetrahedra uniform(mesh, one_law, GetParam());
    const Matrix3d F{{1.1, 0.22, -0.08}, {-0.05, 0.93, 0.17}, {0.12, -0.1, 1.06}};
    const Matrix3Xd exact = (F - Matrix3d::Identity()) * mesh.nodes;
    Conditions conditions;
    Matrix3Xd free_force = uniform.force(exact);
    for (const meshing::InterfaceFace& face : meshing::interface_faces(two_labels())) {
        if (face.outer != 0) continue;
        for (std::size_t k = 0; k < 3; ++k) {
            const int a = face.nodes[k], b = face.nodes[(k + 1) % 3];
            for (const int node : {a, mesh.middle.at(std::minmax(a, b))}) free_force.col(node).setZero();
        }
    }
    for (int i = 0; i < mesh.node_count(); ++i) {
        if (free_force.col(i).isZero(0.0)) conditions.prescribed.push_back({i, {true, true, true}, exact.col(i)});
    }
    EXPECT_LT(free_force.cwiseAbs().maxCoeff(), 1e-9 * uniform.force(exact).cwiseAbs().maxCoeff());
    const Matrix3Xd u = newton_equilibrium(uniform, nodal_conditions(conditions, mesh.node_count())).displacement;
    EXPECT_LT((u - exact).cwiseAbs().maxCoeff(), 1e-8);      // mm
    const double density = strain_energy(one_law.at(1), F);  // kPa
    const double volume = body_load(mesh, Vector3d::UnitX()).row(0).sum();
    if (GetParam().quadrature == Quadrature::Points11) {
        EXPECT_NEAR(uniform.energy(u), density * volume, 1e-9 * volume);
    }
}

TEST(Quadratic, LoadsOfStraightElementsAreConsistent) {
    const meshing::TetMesh linear = meshing::box_mesh({6.0, 4.0, 5.0}, {2, 1, 1});
    const QuadraticMesh mesh = quadratic_mesh(linear);
    const Matrix3Xd weight = body_load(mesh, {0.0, 0.0, -2.0});
    EXPECT_NEAR(weight.row(2).sum(), -240.0, 1e-12);
    // Work on a quadratic displacement: ∫ −2 z² over the box.
    EXPECT_NEAR(weight.row(2).dot(mesh.nodes.row(2).cwiseAbs2()), -2.0 * 24.0 * 125.0 / 3.0, 1e-10);
    Matrix3Xd load = Matrix3Xd::Zero(3, mesh.node_count());
    for (const meshing::InterfaceFace& face : meshing::interface_faces(linear)) {
        const auto on_top = [&](int node) { return linear.nodes(2, node) > 5.0 - 1e-9; };
        if (on_top(face.nodes[0]) && on_top(face.nodes[1]) && on_top(face.nodes[2])) {
            add_traction(mesh, face.nodes, {3.0, 0.0, 0.0}, load);
        }
    }
    EXPECT_NEAR(load.row(0).sum(), 72.0, 1e-12);
    EXPECT_NEAR(load.row(0).dot(mesh.nodes.row(0).cwiseAbs2()), 3.0 * 4.0 * 72.0, 1e-10);
}

// u = 1.5 mm (sin y', sin z', 0) on a cube of 10 mm with y' = π y / 20: det F = 1. Its body force is found by
// differences of P. Prescribed on the whole boundary: the displacement error falls with the third power of the
// element's size.
struct Manufactured {
    static constexpr double edge = 10.0, size = 1.5;
    Material material = NeoHookeanIso{1.0, 10.0};

    static Vector3d displacement(const Vector3d& X) {
        const double k = M_PI / (2.0 * edge);
        return size * Vector3d(std::sin(k * X[1]), std::sin(k * X[2]), 0.0);
    }
    static Matrix3d gradient(const Vector3d& X) {
        const double k = M_PI / (2.0 * edge);
        Matrix3d F = Matrix3d::Identity();
        F(0, 1) += size * k * std::cos(k * X[1]);
        F(1, 2) += size * k * std::cos(k * X[2]);
        return F;
    }
    [[nodiscard]] Vector3d body_force(const Vector3d& X) const {
        Vector3d divergence = Vector3d::Zero();
        const double step = 1e-3;
        for (int j = 0; j < 3; ++j) {
            const Vector3d h = step * Vector3d::Unit(j);
            divergence += (first_piola_kirchhoff_stress(material, gradient(X + h)).col(j) -
                           first_piola_kirchhoff_stress(material, gradient(X - h)).col(j)) /
                          (2.0 * step);
        }
        return -divergence;
    }

    // Largest displacement error at the corners and middles, mm.
    [[nodiscard]] double error(int cells, QuadraticPressure pressure) const {
        const QuadraticMesh mesh = quadratic_mesh(meshing::box_mesh(Vector3d::Constant(edge), {cells, cells, cells}));
        const QuadraticTetrahedra elements(mesh, {{1, material}}, {Quadrature::Points11, pressure});
        Conditions conditions;
        conditions.external_force = Matrix3Xd::Zero(3, mesh.node_count());
        for (int t = 0; t < mesh.tet_count(); ++t) {
            Eigen::Matrix<double, 3, 10> X;
            for (int c = 0; c < 10; ++c) X.col(c) = mesh.nodes.col(mesh.tets(c, t));
            for (const detail::QuadraturePoint& p : detail::tetrahedron_rule(Quadrature::Points11)) {
                const auto N = quadratic_shape(p.local);
                const double volume = p.weight * (X * quadratic_shape_derivatives(p.local)).determinant();
                const Vector3d f = volume * body_force(X * N);
                for (int c = 0; c < 10; ++c) conditions.external_force.col(mesh.tets(c, t)) += N[c] * f;
            }
        }
        for (int i = 0; i < mesh.node_count(); ++i) {
            const Vector3d X = mesh.nodes.col(i);
            if (X.minCoeff() > 1e-9 && X.maxCoeff() < edge - 1e-9) continue;
            conditions.prescribed.push_back({i, {true, true, true}, displacement(X)});
        }
        const Matrix3Xd u = newton_equilibrium(elements, nodal_conditions(conditions, mesh.node_count())).displacement;
        double sum = 0.0;
        for (int i = 0; i < mesh.node_count(); ++i) sum += (u.col(i) - displacement(mesh.nodes.col(i))).squaredNorm();
        return std::sqrt(sum / mesh.node_count());
    }
};

TEST(Quadratic, ConvergesWithThirdOrder) {
    const Manufactured problem;
    const double coarse = problem.error(2, QuadraticPressure::Pointwise),
                 fine = problem.error(4, QuadraticPressure::Pointwise);
    EXPECT_GT(std::log2(coarse / fine), 2.7);
    EXPECT_LT(fine, 1e-3);  // mm, of 1.5 mm
}

TEST(Quadratic, NodalAverageConvergesWithThirdOrderNearIncompressibility) {
    const Manufactured problem{.material = NeoHookeanIso{1.0, 1e4}};
    const double coarse = problem.error(2, QuadraticPressure::NodalAverage),
                 fine = problem.error(4, QuadraticPressure::NodalAverage);
    EXPECT_GT(std::log2(coarse / fine), 2.5);
}

TEST(Quadratic, MissingMaterialsAndInvertedElementsAreRefused) {
    const meshing::TetMesh mesh = two_labels();
    EXPECT_THROW(QuadraticTetrahedra(quadratic_mesh(mesh), {{1, NeoHookeanIso{1.0, 10.0}}}), InvalidInput);
    const auto far = [](const Vector3d& a, const Vector3d& b) { return Vector3d(a + 3.0 * (b - a)); };
    EXPECT_THROW(QuadraticTetrahedra(quadratic_mesh(mesh, far), two_laws), InvalidInput);
    const QuadraticMesh curved = quadratic_mesh(mesh);
    const QuadraticTetrahedra elements(curved, two_laws);
    const Matrix3Xd turned = -2.0 * curved.nodes;
    EXPECT_THROW(static_cast<void>(elements.force(turned)), SolverFailure);
    EXPECT_EQ(elements.energy(turned), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace tissuewarp::tled
