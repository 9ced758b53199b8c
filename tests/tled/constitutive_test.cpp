#include "tled/material/constitutive.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <array>
#include <cmath>
#include <vector>

#include "core/errors.hpp"

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;

const Eigen::Vector3d fibre = Eigen::Vector3d(1, 2, -0.5).normalized();

// One of every law, and laws that are special cases of others; kPa.
const std::vector<Material> materials{
    NeoHookeanIso{1.007, 50.0},
    NeoHookeanLnJ{1.007, 49.329},
    NeoHookeanStable{1.007, 49.329},
    tled::Polynomial{0.3, 0.15, 0.08, 0.06, 0.04, 0.02, 50.0},
    mooney_rivlin(0.3, 0.2, 50.0),
    yeoh(0.5, 0.1, 0.05, 50.0),
    ArrudaBoyce{1.007, 1.1, 50.0},
    Ogden{{OgdenTerm{1.007, 2.0}}, 50.0},
    Ogden{{OgdenTerm{0.8, 2.5}, OgdenTerm{-0.3, -3.0}, OgdenTerm{0.05, 8.0}}, 50.0},
    TransverselyIsotropic{1.007, 50.0, 2.0, fibre},
};

bool isotropic(const Material& material) {
    return !std::holds_alternative<TransverselyIsotropic>(material);
}

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

struct Known {
    Material material;
    std::array<double, 6> S;  // Pa: 11 22 33 12 23 13
    double W;                 // J/m³
};

// Likewise; the last figure of each value is uncertain.
TEST(Constitutive, OtherLawsMeetIndependentValues) {
    for (const Known& known :
         {Known{ArrudaBoyce{1.007, 1.1, 50.0}, {3448.12, 4151.55, 3821.68, -184.442, -63.546, -14.353}, 291.3150},
          Known{tled::Polynomial{0.3, 0.15, 0.08, 0.06, 0.04, 0.0, 50.0},
                {3184.51, 4908.78, 4131.91, -452.495, -151.525, -38.560},
                203.4173},
          Known{TransverselyIsotropic{1.007, 50.0, 2.0, Eigen::Vector3d::UnitX()},
                {4134.52, 4056.60, 3428.73, -351.058, -120.950, -27.3188},
                346.5271}}) {
        const Matrix3d S = 1000.0 * sheared.inverse() * first_piola_kirchhoff_stress(known.material, sheared);
        constexpr std::array<std::array<int, 2>, 6> place{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {0, 2}}};
        for (std::size_t k = 0; k < 6; ++k)
            EXPECT_NEAR(S(place[k][0], place[k][1]), known.S[k], k < 3 ? 0.01 : 0.001) << law_name(known.material) << k;
        EXPECT_NEAR(1000.0 * strain_energy(known.material, sheared), known.W, 0.0001) << law_name(known.material);
    }
}

// μ_p/α_p with α = 2 is the neo-Hookean law, ±2 the Mooney–Rivlin law.
TEST(Constitutive, OgdensLawHoldsTheOthersAsSpecialCases) {
    const auto same = [](const Material& ogden, const Material& other) {
        const Matrix3d P = first_piola_kirchhoff_stress(other, sheared);
        EXPECT_LT((first_piola_kirchhoff_stress(ogden, sheared) - P).norm(), 1e-12 * P.norm());
        EXPECT_NEAR(strain_energy(ogden, sheared), strain_energy(other, sheared), 1e-12);
    };
    same(Ogden{{OgdenTerm{1.007, 2.0}}, 50.0}, NeoHookeanIso{1.007, 50.0});
    same(Ogden{{OgdenTerm{0.6, 2.0}, OgdenTerm{-0.4, -2.0}}, 50.0}, mooney_rivlin(0.3, 0.2, 50.0));
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
        EXPECT_LT((central_difference(W, sheared, 1e-5) - P).norm(), 1e-8 * P.norm()) << law_name(material);
        const auto Psi = [&](const Matrix3d& F) { return shear_energy(material, F); };
        const Matrix3d P_shear = shear_stress(material, sheared);
        EXPECT_LT((central_difference(Psi, sheared, 1e-5) - P_shear).norm(), 1e-7 * P_shear.norm())
            << law_name(material);
    }
}

// States with distinct, nearly equal and equal stretches, far and near rest.
std::vector<Matrix3d> states() {
    const Matrix3d R = Eigen::AngleAxisd(0.4, Eigen::Vector3d(3, 1, -2).normalized()).toRotationMatrix();
    return {sheared,
            Matrix3d::Identity(),
            R * Matrix3d(Eigen::Vector3d(1.3, 1.3, 0.7).asDiagonal()) * R.transpose(),
            R * Matrix3d(Eigen::Vector3d(1.3, 1.3 + 1e-7, 0.7).asDiagonal()),
            R * Matrix3d(Eigen::Vector3d(1.3, 1.3 + 1e-4, 0.7).asDiagonal()),
            Matrix3d(Eigen::Vector3d(0.4, 2.0, 1.1).asDiagonal())};
}

TEST(Constitutive, TangentIsTheDerivativeOfTheStress) {
    const double step = 1e-5;
    for (const Material& material : materials) {
        for (const Matrix3d& F : states()) {
            const VolumetricFunction U = volumetric_function(material, F.determinant());
            const double M = volumetric_modulus(material);
            Tangent tangent = shear_tangent(material, F);
            add_volumetric_tangent(tangent, M * U.first, M * U.second);
            const Eigen::Matrix<double, 9, 9> matrix = tangent.matrix();
            EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-9 * matrix.norm()) << law_name(material);
            for (int i = 0; i < 9; ++i) {
                Matrix3d dF = Matrix3d::Zero();
                dF.data()[i] = step;
                const Matrix3d dP =
                    (first_piola_kirchhoff_stress(material, F + dF) - first_piola_kirchhoff_stress(material, F - dF)) /
                    (2 * step);
                EXPECT_LT((dP.reshaped() - matrix.col(i)).norm(), 2e-8 * matrix.norm()) << law_name(material) << "\n"
                                                                                        << F << "\n"
                                                                                        << i;
            }
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
        EXPECT_NEAR(strain_energy(material, Matrix3d::Identity()), 0.0, 1e-15) << law_name(material);
        EXPECT_LT(first_piola_kirchhoff_stress(material, Matrix3d::Identity()).norm(), 1e-15) << law_name(material);
        if (!isotropic(material)) continue;
        Tangent tangent = shear_tangent(material, Matrix3d::Identity());
        add_volumetric_tangent(tangent, 0.0, volumetric_modulus(material));
        const double mu = shear_modulus(material), lambda = p_wave_modulus(material) - 2 * mu;
        const Matrix3d hooke = 2 * mu * strain + lambda * strain.trace() * Matrix3d::Identity();
        EXPECT_LT((tangent.apply(dF) - hooke).norm(), 1e-12 * hooke.norm()) << law_name(material);
    }
}

// Along the fibre W gains η/2 (4/3 ε)² at a uniaxial strain ε, so the axial modulus is κ + 4μ/3 + 16η/9.
TEST(Constitutive, FibresStiffenTheirDirectionAlone) {
    const TransverselyIsotropic law{1.007, 50.0, 2.0, fibre};
    const Tangent tangent = [&] {
        Tangent result = shear_tangent(law, Matrix3d::Identity());
        add_volumetric_tangent(result, 0.0, law.bulk_modulus);
        return result;
    }();
    const auto stretched = [&](const Eigen::Vector3d& n) {
        const Matrix3d strain = n * n.transpose();
        return n.dot(tangent.apply(strain) * n);
    };
    EXPECT_NEAR(stretched(fibre), p_wave_modulus(law), 1e-12);
    EXPECT_NEAR(stretched(fibre), 50.0 + 4 * 1.007 / 3 + 16 * 2.0 / 9, 1e-12);
    // Across: I₄ bar falls by 2/3 ε.
    EXPECT_NEAR(stretched(fibre.unitOrthogonal()), 50.0 + 4 * 1.007 / 3 + 4 * 2.0 / 9, 1e-12);
}

// W(F Q) = W(F) for every rotation Q of an isotropic material, for those about the fibre of a transversely isotropic
// one.
TEST(Constitutive, MaterialSymmetry) {
    const Matrix3d any = Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
    const Matrix3d about_fibre = Eigen::AngleAxisd(0.8, fibre).toRotationMatrix();
    for (const Material& material : materials) {
        const double W = strain_energy(material, sheared);
        EXPECT_NEAR(strain_energy(material, sheared * about_fibre), W, 1e-13) << law_name(material);
        const double turned = strain_energy(material, sheared * any);
        if (isotropic(material)) {
            EXPECT_NEAR(turned, W, 1e-13) << law_name(material);
        } else {
            EXPECT_GT(std::abs(turned - W), 1e-3);
        }
    }
}

TEST(Constitutive, NamesAndParametersGiveBackTheLaw) {
    for (const Material& material : materials)
        EXPECT_EQ(material_of_law(law_name(material), law_parameters(material)), material) << law_name(material);
    EXPECT_THROW(material_of_law("rubber"), InvalidInput);
    EXPECT_THROW(material_of_law("ogden", {1.0, 2.0}), InvalidInput);
}

TEST(Constitutive, RefusesWhatIsNoMaterial) {
    for (const Material& material :
         {Material(NeoHookeanIso{-1.0, 50.0}), Material(NeoHookeanLnJ{1.0, -2.0}),
          Material(ArrudaBoyce{1.0, 0.9, 50.0}), Material(Ogden{{OgdenTerm{1.0, 0.0}}, 50.0}),
          Material(Ogden{{OgdenTerm{1.0, -2.0}}, 50.0}),
          Material(TransverselyIsotropic{1.0, 50.0, 2.0, Eigen::Vector3d(1, 1, 0)}),
          Material(TransverselyIsotropic{1.0, 50.0, -2.0, fibre}), Material(mooney_rivlin(0.3, -0.4, 50.0))})
        EXPECT_THROW(require_valid(material, "label 3"), InvalidInput) << law_name(material);
    for (const Material& material : materials) EXPECT_NO_THROW(require_valid(material, "label 3"));
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

TEST(Constitutive, InvertedStatesHaveInfiniteEnergyUnlessTheLawAdmitsThem) {
    const Matrix3d inverted = Eigen::Vector3d(1.0, 1.0, -0.2).asDiagonal();
    for (const Material& material : materials) {
        EXPECT_EQ(std::isinf(strain_energy(material, inverted)), !admits_inversion(material)) << law_name(material);
        EXPECT_EQ(std::isinf(shear_energy(material, inverted)), !admits_inversion(material));
        EXPECT_EQ(std::isinf(volumetric_function(material, 0.0).energy), !admits_inversion(material));
    }
}

// Where the volumetric part is averaged, the shear part alone resists volumes that alternate between neighbours.
TEST(Constitutive, TheShearPartNeverGainsByAChangeOfVolume) {
    for (const Material& material : materials)
        for (const double length : {0.97, 0.999, 1.001, 1.03})
            EXPECT_GE(shear_energy(material, length * Matrix3d::Identity()), -1e-12) << law_name(material);
    constexpr double change = 1e-3, mu = 4.0 / 3.0 * 1.007;
    EXPECT_NEAR(shear_energy(NeoHookeanStable{1.007, 49.329}, (1 + change) * Matrix3d::Identity()),
                0.5625 * mu * change * change, 2e-3 * mu * change * change);
}

// The force of an inverted state points back: energy falls as the inverted stretch grows to 1.
TEST(Constitutive, TheStableLawPullsInvertedElementsStraight) {
    const Material material = NeoHookeanStable{1.007, 49.329};
    double last = strain_energy(material, Eigen::Vector3d(1, 1, -1.0).asDiagonal());
    for (double stretch = -0.9; stretch < 1.05; stretch += 0.1) {
        const Matrix3d F = Eigen::Vector3d(1, 1, stretch).asDiagonal();
        const double W = strain_energy(material, F);
        EXPECT_LT(W, last) << stretch;
        if (stretch < 0.95) {
            EXPECT_LT(first_piola_kirchhoff_stress(material, F)(2, 2), 0.0) << stretch;
        }
        last = W;
    }
}

}  // namespace
}  // namespace tissuewarp::tled
