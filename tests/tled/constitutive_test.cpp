#include "tled/constitutive.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <vector>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;

// μ, κ and λ in kPa.
const std::vector<Material> materials{NeoHookeanIso{1.007, 50.0}, NeoHookeanLnJ{1.007, 49.329}};

const Matrix3d sheared{{1.2, 0.1, 0.0}, {0.05, 0.9, 0.08}, {0.02, -0.03, 1.0}};

template <typename Function>
Matrix3d central_difference(const Function& f, const Matrix3d& F, double step) {
    Matrix3d result;
    for (int i = 0; i < 9; ++i) {
        Matrix3d up = F, down = F;
        up.data()[i] += step;
        down.data()[i] -= step;
        result.data()[i] = (f(up) - f(down)) / (2 * step);
    }
    return result;
}

// Values of an independent finite-difference computation of W: S in Pa in the order 11, 22, 33, 12, 23, 13, W in J/m³.
TEST(Constitutive, IsochoricLawMeetsIndependentValues) {
    const Material material = NeoHookeanIso{1.007, 50.0};
    const Matrix3d S = 1000.0 * sheared.inverse() * first_piola_kirchhoff_stress(material, sheared);
    EXPECT_NEAR(S(0, 0), 3201.09, 0.01);
    EXPECT_NEAR(S(1, 1), 4907.72, 0.01);
    EXPECT_NEAR(S(2, 2), 4107.40, 0.01);
    EXPECT_NEAR(S(0, 1), -447.479, 0.001);
    EXPECT_NEAR(S(1, 2), -154.171, 0.001);
    EXPECT_NEAR(S(0, 2), -34.8221, 0.0001);
    EXPECT_NEAR(1000.0 * strain_energy(material, sheared), 207.8478, 0.0001);
}

// Confined stretch 1.3 of an isochoric block, μ 1.052 kPa, κ 52.249 kPa, area 10⁴ mm²: 159 872.1 mN.
TEST(Constitutive, ConfinedStretchForce) {
    const Matrix3d F = Eigen::Vector3d(1.0, 1.0, 1.3).asDiagonal();
    EXPECT_NEAR(1e4 * first_piola_kirchhoff_stress(NeoHookeanIso{1.052, 52.249}, F)(2, 2), 159872.1, 0.1);
}

struct FreeStretch {
    double stretch, lateral, force_mN;
};

// Free uniaxial stretch, λ 49.329 kPa, μ 1.007 kPa, area 10⁴ mm² (isochoric law with κ = λ + 2μ/3).
TEST(Constitutive, FreeStretchHasNoLateralStressAndTheKnownForce) {
    const Material material = NeoHookeanIso{1.007, 49.329 + 2.0 / 3.0 * 1.007};
    for (const FreeStretch& state : {FreeStretch{1.1, 0.95441615, 2734.385}, FreeStretch{1.2, 0.91470542, 5049.276},
                                     FreeStretch{1.3, 0.87972376, 7067.488}, FreeStretch{0.8, 1.11574604, -7634.868}}) {
        const Matrix3d F = Eigen::Vector3d(state.lateral, state.lateral, state.stretch).asDiagonal();
        const Matrix3d P = first_piola_kirchhoff_stress(material, F);
        EXPECT_NEAR(P(0, 0), 0.0, 2e-6) << state.stretch;  // 1e-8 of lateral stretch times the bulk modulus
        EXPECT_NEAR(1e4 * P(2, 2), state.force_mN, 0.02) << state.stretch;
    }
}

// P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ on a diagonal F, by hand.
TEST(Constitutive, LogarithmicLawOnADiagonalStretch) {
    const double mu = 2.0, lambda = 30.0, J = 1.1 * 0.9 * 1.3;
    const Matrix3d F = Eigen::Vector3d(1.1, 0.9, 1.3).asDiagonal();
    const Matrix3d P = first_piola_kirchhoff_stress(NeoHookeanLnJ{mu, lambda}, F);
    for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(P(i, i), mu * (F(i, i) - 1 / F(i, i)) + lambda * std::log(J) / F(i, i), 1e-12);
    }
    EXPECT_NEAR(strain_energy(NeoHookeanLnJ{mu, lambda}, F),
                0.5 * mu * (1.21 + 0.81 + 1.69 - 3.0) - mu * std::log(J) + 0.5 * lambda * std::log(J) * std::log(J),
                1e-12);
}

TEST(Constitutive, StressIsTheDerivativeOfTheEnergy) {
    for (const Material& material : materials) {
        const auto W = [&](const Matrix3d& F) { return strain_energy(material, F); };
        const Matrix3d P = first_piola_kirchhoff_stress(material, sheared);
        EXPECT_LT((central_difference(W, sheared, 1e-5) - P).norm(), 1e-8 * P.norm()) << material.index();
        const auto Psi = [&](const Matrix3d& F) { return shear_energy(material, F); };
        const Matrix3d P_shear = shear_stress(material, sheared);
        EXPECT_LT((central_difference(Psi, sheared, 1e-5) - P_shear).norm(), 1e-7 * P_shear.norm()) << material.index();
    }
}

TEST(Constitutive, TangentIsTheDerivativeOfTheStress) {
    const double J = sheared.determinant(), step = 1e-5;
    for (const Material& material : materials) {
        const VolumetricFunction U = volumetric_function(material, J);
        const double M = volumetric_modulus(material);
        Tangent tangent = shear_tangent(material, sheared);
        add_volumetric_tangent(tangent, M * U.first, M * U.second);
        const Eigen::Matrix<double, 9, 9> matrix = tangent.matrix();
        EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-13 * matrix.norm());
        for (int i = 0; i < 9; ++i) {
            Matrix3d dF = Matrix3d::Zero();
            dF.data()[i] = step;
            const Matrix3d dP = (first_piola_kirchhoff_stress(material, sheared + dF) -
                                 first_piola_kirchhoff_stress(material, sheared - dF)) /
                                (2 * step);
            EXPECT_LT((dP.reshaped() - matrix.col(i)).norm(), 1e-8 * matrix.norm()) << material.index() << " " << i;
        }
    }
}

TEST(Constitutive, VolumetricDerivatives) {
    const double step = 1e-5;
    for (const Material& material : materials) {
        for (double J : {0.4, 1.0, 1.7}) {
            const VolumetricFunction up = volumetric_function(material, J + step),
                                     down = volumetric_function(material, J - step),
                                     U = volumetric_function(material, J);
            EXPECT_NEAR((up.energy - down.energy) / (2 * step), U.first, 1e-8);
            EXPECT_NEAR((up.first - down.first) / (2 * step), U.second, 1e-7);
        }
    }
}

TEST(Constitutive, RestIsFreeOfEnergyAndStressAndHookean) {
    Matrix3d dF{{0.1, 0.3, -0.2}, {0.5, -0.4, 0.7}, {0.2, 0.6, 0.9}};
    const Matrix3d strain = 0.5 * (dF + dF.transpose());
    for (const Material& material : materials) {
        EXPECT_EQ(strain_energy(material, Matrix3d::Identity()), 0.0);
        EXPECT_EQ(first_piola_kirchhoff_stress(material, Matrix3d::Identity()).norm(), 0.0);
        Tangent tangent = shear_tangent(material, Matrix3d::Identity());
        add_volumetric_tangent(tangent, 0.0, volumetric_modulus(material));
        const double mu = shear_modulus(material), lambda = p_wave_modulus(material) - 2 * mu;
        const Matrix3d hooke = 2 * mu * strain + lambda * strain.trace() * Matrix3d::Identity();
        EXPECT_LT((tangent.apply(dF) - hooke).norm(), 1e-12 * hooke.norm()) << material.index();
    }
}

TEST(Constitutive, RotationChangesNeitherEnergyNorTheStressAlongTheMaterial) {
    const Matrix3d R = Eigen::AngleAxisd(2.3, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
    for (const Material& material : materials) {
        EXPECT_NEAR(strain_energy(material, R * sheared), strain_energy(material, sheared), 1e-14);
        const Matrix3d P = first_piola_kirchhoff_stress(material, sheared);
        EXPECT_LT((first_piola_kirchhoff_stress(material, R * sheared) - R * P).norm(), 1e-12 * P.norm());
    }
}

TEST(Constitutive, CofactorAndItsDerivative) {
    const Matrix3d expected = sheared.determinant() * sheared.inverse().transpose();
    EXPECT_LT((cofactor(sheared) - expected).norm(), 1e-14);
    const Matrix3d dF{{0.1, 0.3, -0.2}, {0.5, -0.4, 0.7}, {0.2, 0.6, 0.9}};
    const Matrix3d difference =
        (cofactor(sheared + 0.5 * dF) - cofactor(sheared - 0.5 * dF));  // exact: cof is quadratic
    EXPECT_LT((cofactor_derivative(sheared, dF) - difference).norm(), 1e-14);
    EXPECT_EQ(cofactor(Matrix3d(Eigen::Vector3d(2, 3, 0).asDiagonal())),
              Matrix3d(Eigen::Vector3d(0, 0, 6).asDiagonal()));
}

TEST(Constitutive, InvertedStatesHaveInfiniteEnergy) {
    const Matrix3d inverted = Eigen::Vector3d(1.0, 1.0, -0.2).asDiagonal();
    for (const Material& material : materials) {
        EXPECT_TRUE(std::isinf(strain_energy(material, inverted)));
        EXPECT_TRUE(std::isinf(shear_energy(material, inverted)));
        EXPECT_TRUE(std::isinf(volumetric_function(material, 0.0).energy));
    }
}

}  // namespace
}  // namespace tissuewarp::tled
