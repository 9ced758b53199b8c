#include "tled/model/internal_force.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

// A small jittered box of two labels with one law each.
Model two_laws(Element element) {
    Model model;
    model.mesh = meshing::box_mesh({30.0, 20.0, 25.0}, {3, 2, 2}, 0.1, 7);
    for (int t = 0; t < model.mesh.tet_count(); ++t) {
        Vector3d centre = Vector3d::Zero();
        for (int node : model.mesh.tets.col(t)) centre += model.mesh.nodes.col(node) / 4;
        model.mesh.labels[t] = centre.x() < 14.0 ? 1 : 2;
    }
    model.materials[1] = NeoHookeanIso{1.007, 20.0};
    model.materials[2] = NeoHookeanLnJ{2.5, 30.0};
    model.element = element;
    return model;
}

// A smooth displacement with strains of about 10 %, mm.
Matrix3Xd wavy(const Matrix3Xd& X) {
    Matrix3Xd u(3, X.cols());
    for (int i = 0; i < X.cols(); ++i) {
        u.col(i) << std::sin(0.11 * X(1, i) + 0.05 * X(2, i)), 0.8 * std::cos(0.13 * X(0, i)),
            0.7 * std::sin(0.1 * X(0, i));
    }
    return u;
}

Matrix3Xd linear(const Matrix3Xd& X, const Matrix3d& F) {
    return (F - Matrix3d::Identity()) * X;
}

class Reference : public testing::TestWithParam<Element> {
protected:
    Model model = two_laws(GetParam());
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
};

INSTANTIATE_TEST_SUITE_P(Elements, Reference, testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return each.param == Element::T4 ? "T4" : "AveragedPressure"; });

TEST_P(Reference, ForceIsTheGradientOfTheEnergy) {
    const Matrix3Xd u = wavy(X), force = internal_force(rest, u);
    const double step = 1e-4;  // mm
    for (int d = 0; d < u.size(); ++d) {
        Matrix3Xd up = u, down = u;
        up.data()[d] += step;
        down.data()[d] -= step;
        const double difference = (elastic_energy(rest, up) - elastic_energy(rest, down)) / (2 * step);
        EXPECT_NEAR(force.data()[d], difference, 1e-7 * force.cwiseAbs().maxCoeff()) << d;
    }
}

TEST_P(Reference, StiffnessIsTheGradientOfTheForceAndSymmetric) {
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

TEST_P(Reference, ForcesHaveNeitherSumNorMoment) {
    const Matrix3Xd u = wavy(X), force = internal_force(rest, u);
    Vector3d moment = Vector3d::Zero();
    for (int i = 0; i < u.cols(); ++i) moment += (X.col(i) + u.col(i)).cross(force.col(i));
    const double size = force.colwise().norm().sum();
    EXPECT_GT(size, 100.0);  // mN
    EXPECT_LT(force.rowwise().sum().norm(), 1e-13 * size);
    EXPECT_LT(moment.norm(), 1e-12 * size * X.cwiseAbs().maxCoeff());
}

TEST_P(Reference, RigidMotionCostsNothing) {
    const Matrix3d R = Eigen::AngleAxisd(1.9, Vector3d(0.3, 1.0, -0.4).normalized()).toRotationMatrix();
    const Matrix3Xd u = linear(X, R).colwise() + Vector3d(5.0, -7.0, 11.0);
    EXPECT_NEAR(elastic_energy(rest, u), 0.0, 1e-9);                  // mN mm
    EXPECT_LT(internal_force(rest, u).cwiseAbs().maxCoeff(), 1e-10);  // mN
    EXPECT_LT((jacobians(rest, u).array() - 1.0).abs().maxCoeff(), 1e-12);
}

TEST_P(Reference, ForcesTurnWithTheTissue) {
    const Matrix3d R = Eigen::AngleAxisd(1.9, Vector3d(0.3, 1.0, -0.4).normalized()).toRotationMatrix();
    const Matrix3Xd u = wavy(X), turned = R * (X + u) - X;
    const Matrix3Xd force = internal_force(rest, u);
    EXPECT_NEAR(elastic_energy(rest, turned), elastic_energy(rest, u), 1e-11 * elastic_energy(rest, u));
    EXPECT_LT((internal_force(rest, turned) - R * force).norm(), 1e-11 * force.norm());
}

// Homogeneous strain of one material: E = V W(F), and the force on every face is P N times its area.
TEST_P(Reference, HomogeneousStrainHasTheEnergyAndTractionOfTheLaw) {
    for (const Material& material : {Material{NeoHookeanIso{1.007, 20.0}}, Material{NeoHookeanLnJ{2.5, 30.0}}}) {
        model.materials[1] = model.materials[2] = material;
        rest = rest_state(model);
        const Matrix3d F{{1.15, 0.1, 0.0}, {0.05, 0.9, 0.08}, {0.02, -0.03, 1.05}};
        const Matrix3Xd u = linear(X, F), force = internal_force(rest, u);
        const double volume = 30.0 * 20.0 * 25.0, J = F.determinant(), area = 20.0 * 25.0;
        const Matrix3d G = F.inverse().transpose();
        double W = 0.0;
        Matrix3d P;
        if (const auto* iso = std::get_if<NeoHookeanIso>(&material)) {
            const double I = F.squaredNorm(), j = std::pow(J, -2.0 / 3.0);
            W = 0.5 * iso->shear_modulus * (j * I - 3) + 0.5 * iso->bulk_modulus * (J - 1) * (J - 1);
            P = iso->shear_modulus * j * (F - I / 3 * G) + iso->bulk_modulus * (J - 1) * J * G;
        } else {
            const auto& log = std::get<NeoHookeanLnJ>(material);
            W = 0.5 * log.shear_modulus * (F.squaredNorm() - 3) - log.shear_modulus * std::log(J) +
                0.5 * log.lame_lambda * std::log(J) * std::log(J);
            P = log.shear_modulus * (F - G) + log.lame_lambda * std::log(J) * G;
        }
        EXPECT_NEAR(elastic_energy(rest, u), volume * W, 1e-11 * volume * W);
        Vector3d face = Vector3d::Zero();
        for (int i = 0; i < X.cols(); ++i) {
            const bool inside =
                (X.col(i).array() > 1e-9).all() && X(0, i) < 30 - 1e-9 && X(1, i) < 20 - 1e-9 && X(2, i) < 25 - 1e-9;
            if (inside) {
                EXPECT_LT(force.col(i).norm(), 1e-10 * force.norm());
            }
        }
        // Virtual displacement x/Lx · c gives c·P e_x area.
        for (int i = 0; i < X.cols(); ++i) face += X(0, i) / 30.0 * force.col(i);
        EXPECT_LT((face - area * P.col(0)).norm(), 1e-11 * area * P.norm());
    }
}

TEST_P(Reference, JacobiansFollowTheOrderOfTheMesh) {
    // Rest positions of label 2 and of label 1 are told apart by a displacement of two strains.
    model.materials[1] = NeoHookeanLnJ{1.0, 10.0};  // label 2 comes first in the internal order after this swap
    model.materials[2] = NeoHookeanIso{1.0, 10.0};
    rest = rest_state(model);
    const Matrix3Xd u = wavy(X);
    const Eigen::VectorXd J = jacobians(rest, u), before = meshing::tet_volumes(model.mesh);
    meshing::TetMesh deformed = model.mesh;
    deformed.nodes += u;
    EXPECT_LT((J.array() - meshing::tet_volumes(deformed).array() / before.array()).abs().maxCoeff(), 1e-12);
}

TEST_P(Reference, OneThreadAndManyGiveTheSameBits) {
    const Matrix3Xd u = wavy(X);
    const Matrix3Xd force = internal_force(rest, u);
    const Eigen::SparseMatrix<double> K = tangent_stiffness(rest, u);
    const double energy = elastic_energy(rest, u);
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(force, internal_force(rest, u));
    EXPECT_EQ(energy, elastic_energy(rest, u));
    EXPECT_EQ((K - tangent_stiffness(rest, u)).norm(), 0.0);
}

TEST_P(Reference, InvertedTetrahedronIsInfiniteInEnergyAndRefusedInForce) {
    Matrix3Xd u = Matrix3Xd::Zero(3, X.cols());
    u.col(0) << 100.0, 100.0, 100.0;
    EXPECT_TRUE(std::isinf(elastic_energy(rest, u)));
    EXPECT_THROW(static_cast<void>(internal_force(rest, u)), SolverFailure);
    EXPECT_THROW(static_cast<void>(tangent_stiffness(rest, u)), SolverFailure);
}

// The averaged element's energy from its definition, with dense loops over nodes.
TEST(AveragedPressure, EnergyIsThatOfNodalVolumes) {
    Model model = two_laws(Element::AveragedPressureT4);
    model.materials[1] = NeoHookeanIso{1e-9, 20.0};  // next to no shear energy
    model.materials[2] = NeoHookeanIso{2e-9, 20.0};  // another material, so that the pressure may jump
    const RestState rest = rest_state(model);
    const Matrix3Xd u = wavy(model.mesh.nodes);
    const Eigen::VectorXd J = jacobians(rest, u), V = meshing::tet_volumes(model.mesh);
    double energy = 0.0;
    for (int label : {1, 2}) {
        for (int a = 0; a < model.mesh.node_count(); ++a) {
            double before = 0.0, after = 0.0;
            for (int t = 0; t < model.mesh.tet_count(); ++t) {
                if (model.mesh.labels[t] != label || (model.mesh.tets.col(t).array() != a).all()) continue;
                before += 0.25 * V[t];
                after += 0.25 * V[t] * J[t];
            }
            if (before > 0) energy += before * 20.0 * 0.5 * std::pow(after / before - 1.0, 2);
        }
    }
    EXPECT_GT(energy, 0.5);  // mN mm
    EXPECT_NEAR(elastic_energy(rest, u), energy, 1e-6 * energy);
}

}  // namespace
}  // namespace tissuewarp::tled
