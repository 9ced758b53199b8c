// Ogden's law in principal stretches (Holzapfel, Nonlinear Solid Mechanics, 2000, sections 6.5 and 6.6).

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <cmath>

#include "tled/material/laws.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// C = Σ c_i n_i n_iᵀ; T_i = Σ_p μ_p (x_i − x̄), x_i = λ̄_i^α_p, are the principal Kirchhoff stresses, so that
/// S = Σ T_i/c_i n_i n_iᵀ.
struct PrincipalFrame {
    Vector3d c, T = Vector3d::Zero();
    Matrix3d n;                      // columns
    Matrix3d dT = Matrix3d::Zero();  // ∂T_i/∂ ln c_k
    double energy = 0;

    PrincipalFrame(const Ogden& law, const Matrix3d& F) {
        const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(F.transpose() * F);
        c = solver.eigenvalues();
        n = solver.eigenvectors();
        const double J = F.determinant();
        for (const OgdenTerm& term : law.terms) {
            if (term.modulus == 0.0) continue;
            const Vector3d x = c.array().pow(term.exponent / 2) * std::pow(J, -term.exponent / 3);
            const double mean = x.mean(), rate = term.modulus * term.exponent / 2;
            energy += term.modulus / term.exponent * (3 * mean - 3.0);
            T += term.modulus * (x.array() - mean).matrix();
            // ∂x_i/∂ ln c_k = α/2 (δ_ik − 1/3) x_i.
            for (int i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k)
                    dT(i, k) += rate * (((i == k ? 1.0 : 0.0) - 1.0 / 3.0) * x[i] - (x[k] - mean) / 3.0);
        }
    }
    [[nodiscard]] Vector3d S() const { return T.cwiseQuotient(c); }
    /// ∂S_i/∂c_k of the principal values.
    [[nodiscard]] double dS(int i, int k) const { return (dT(i, k) - (i == k ? T[i] : 0.0)) / (c[i] * c[k]); }
};

}  // namespace

double shear_energy_of(const Ogden& law, const Matrix3d& F) {
    return PrincipalFrame(law, F).energy;
}

Matrix3d shear_stress_of(const Ogden& law, const Matrix3d& F) {
    const PrincipalFrame frame(law, F);
    return F * frame.n * frame.S().asDiagonal() * frame.n.transpose();
}

// In the principal frame dS_ii = Σ_k ∂S_i/∂c_k dC_kk and dS_ik = (S_i − S_k)/(c_i − c_k) dC_ik, whose limit for equal
// stretches is ∂S_i/∂c_i − ∂S_i/∂c_k.
Matrix3d shear_derivative_of(const Ogden& law, const Matrix3d& F, const Matrix3d& dF) {
    constexpr double nearly_equal =
        1e-5;  // relative; the quotient loses half its digits there, the limit errs as little
    const PrincipalFrame frame(law, F);
    const Vector3d S = frame.S();
    const Matrix3d dC = frame.n.transpose() * (dF.transpose() * F + F.transpose() * dF) * frame.n;
    Matrix3d dS;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) {
            if (i == k) {
                dS(i, i) = frame.dS(i, 0) * dC(0, 0) + frame.dS(i, 1) * dC(1, 1) + frame.dS(i, 2) * dC(2, 2);
                continue;
            }
            const double gap = frame.c[i] - frame.c[k];
            const bool equal = std::abs(gap) < nearly_equal * frame.c[i];
            const double limit = 0.5 * (frame.dS(i, i) - frame.dS(i, k) + frame.dS(k, k) - frame.dS(k, i));
            dS(i, k) = (equal ? limit : (S[i] - S[k]) / gap) * dC(i, k);
        }
    const auto in_space = [&](const Matrix3d& principal) {
        return Matrix3d(frame.n * principal * frame.n.transpose());
    };
    return dF * in_space(S.asDiagonal()) + F * in_space(dS);
}

}  // namespace tissuewarp::tled::detail
