#pragma once
/// What is computed once for the one-point hexahedra of a model (Flanagan and Belytschko 1981; in total Lagrangian form
/// Joldes, Wittek, Miller 2008).

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled {

/// Elements [begin, end) of the internal order share one material.
struct MaterialBlock {
    int material = 0;  ///< index into RestState::materials
    int begin = 0, end = 0;
};

/// Node-to-element lists in compressed form: entries [offset[a], offset[a+1]) are corners·element + corner, ascending,
/// in the internal element order; `corners` is 4 for tetrahedra, 8 for hexahedra.
struct Incidence {
    std::vector<int> offset, entry;
};

/// Arrays of M hexahedra in the internal order, grouped by material; all empty in a model without hexahedra.
///
/// Energy of one: V [Ψ(F) + M U(det F)] + ½ k Σ_α |q_α|² with the mean deformation gradient F = I + Σ u_I ⊗ ∇N_I and
/// the hourglass displacements q_α = Σ_I γ_αI u_I, γ_αI = Γ_αI − Σ_j ∂N_I/∂X_j X^Γ_jα, α = 1…4. γ is orthogonal to
/// every linear displacement, a finite rotation included.
struct HexState {
    std::vector<int> hex;               ///< internal position → hexahedron of the model
    std::vector<MaterialBlock> blocks;  ///< one for each material that has hexahedra
    Eigen::Matrix<int, 8, Eigen::Dynamic> nodes;
    Eigen::Matrix<double, 21, Eigen::Dynamic>
        gradient;                        ///< row 3k+j is the mean ∂N_{k+1}/∂X_j, 1/mm; N_0 = −Σ of the others
    Eigen::VectorXd volume;              ///< mm³
    Eigen::VectorXd volumetric_modulus;  ///< kPa
    Eigen::Matrix<double, 12, Eigen::Dynamic>
        rest_hourglass;                   ///< row 3α+j is X^Γ_jα = Σ_I Γ_αI X_jI, mm; zero for parallelepipeds
    Eigen::VectorXd hourglass_stiffness;  ///< k = c μ V Σ_I |∇N_I|², mN/mm
    Eigen::Matrix3Xd fibre;               ///< 3 × M, unit vectors; empty where no material has fibres
    Incidence incidence;                  ///< node → 8·element + corner

    [[nodiscard]] int count() const { return static_cast<int>(hex.size()); }
};

/// Γ: the four base vectors ηζ, ζξ, ξη and ξηζ at the corners.
inline constexpr int hourglass_base[4][8] = {{1, 1, -1, -1, -1, -1, 1, 1},
                                             {1, -1, -1, 1, -1, 1, 1, -1},
                                             {1, -1, 1, -1, 1, -1, 1, -1},
                                             {-1, 1, -1, 1, 1, -1, 1, -1}};

}  // namespace tissuewarp::tled
