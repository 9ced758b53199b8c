// Total Lagrangian explicit dynamics in the order and the symbols of Miller et al. (2007), table 1, and Taylor, Cheng,
// Ourselin (2007), section 2: deformation gradient, right Cauchy–Green deformation, second Piola–Kirchhoff stress,
// nodal forces, central differences. The increment u − u⁻ is kept in place of u⁻, as all engines here do.

#include "tled/reference/scalar_steps.hpp"

#include "core/errors.hpp"

#include <cmath>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;
using Vector = std::array<float, 3>;
using Matrix = std::array<Vector, 3>;

void refuse_if(bool unknown, const std::string& what) {
    if (unknown) throw InvalidInput("the scalar steps do not know " + what + "; take make_cpu_engine()");
}

void require_columns(Eigen::Index columns, Eigen::Index node_count, const char* what) {
    if (columns != node_count)
        throw InvalidInput(std::string(what) + " has " + std::to_string(columns) + " columns; the model has " +
                           std::to_string(node_count) + " nodes");
}

void require_known(const RestState& rest, const NodalConditions& conditions) {
    refuse_if(rest.pressure.count() > 0, "averaged pressure");
    refuse_if(!rest.viscosity.empty(), "viscosity");
    for (const Material& material : rest.materials)
        refuse_if(!std::holds_alternative<NeoHookeanIso>(material) && !std::holds_alternative<NeoHookeanLnJ>(material),
                  "the law " + law_name(material));
    refuse_if(!conditions.spring_node.empty(), "springs");
    refuse_if(conditions.external_force.size() > 0 && !conditions.external_force.isZero(0.0), "external forces");
    require_columns(conditions.constrained.cols(), rest.node_count, "the set of conditions");
    require_columns(conditions.imposed.cols(), rest.node_count, "the imposed displacement");
}

/// A Bᵀ.
Matrix times_transposed(const Matrix& A, const Matrix& B) {
    Matrix product;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) product[i][j] = A[i][0] * B[j][0] + A[i][1] * B[j][1] + A[i][2] * B[j][2];
    return product;
}

Matrix transposed(const Matrix& A) {
    return {{{A[0][0], A[1][0], A[2][0]}, {A[0][1], A[1][1], A[2][1]}, {A[0][2], A[1][2], A[2][2]}}};
}

/// Of a symmetric matrix.
Matrix adjugate(const Matrix& C) {
    Matrix adj;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) {
            const std::size_t a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            adj[i][j] = C[a][c] * C[b][d] - C[a][d] * C[b][c];
        }
    return adj;
}

std::vector<Vector> vectors_of(const Matrix3Xd& matrix) {
    std::vector<Vector> result(static_cast<std::size_t>(matrix.cols()));
    for (std::size_t a = 0; a < result.size(); ++a)
        for (std::size_t i = 0; i < 3; ++i)
            result[a][i] = float(matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(a)));
    return result;
}

Matrix3Xd matrix_of(const std::vector<Vector>& vectors) {
    Matrix3Xd result(3, static_cast<Eigen::Index>(vectors.size()));
    for (std::size_t a = 0; a < vectors.size(); ++a)
        for (std::size_t i = 0; i < 3; ++i)
            result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(a)) = double(vectors[a][i]);
    return result;
}

/// Inverse mass zero holds a component: it needs no mask and no branch in the step.
std::vector<Vector> inverse_masses(const Matrix3Xd& mass, const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained) {
    require_columns(mass.cols(), constrained.cols(), "the mass");
    for (Eigen::Index i = 0; i < mass.size(); ++i)
        if (const double m = mass.reshaped()[i]; !(m > 0) || !std::isfinite(m))
            throw InvalidInput("the mass of node " + std::to_string(i / 3) + " is " + std::to_string(m) +
                               "; it must be positive");
    return vectors_of(constrained.select(Matrix3Xd::Zero(3, mass.cols()), mass.cwiseInverse()));
}

}  // namespace

ScalarSteps::ScalarSteps(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& mass)
    : constrained_(conditions.constrained), imposed_(conditions.imposed) {
    require_known(rest, conditions);
    inverse_mass_ = inverse_masses(mass, constrained_);
    force_.assign(inverse_mass_.size(), Vector{});
    for (const Material& material : rest.materials) {
        if (const auto* iso = std::get_if<NeoHookeanIso>(&material))
            materials_.push_back({true, float(iso->shear_modulus), float(iso->bulk_modulus)});
        else if (const auto* lnj = std::get_if<NeoHookeanLnJ>(&material))
            materials_.push_back({false, float(lnj->shear_modulus), float(lnj->lame_lambda)});
    }
    const std::vector<int> material = material_of_elements(rest);
    for (int e = 0; e < rest.element_count(); ++e) {
        Element element{{}, {}, float(rest.volume[e]), material[static_cast<std::size_t>(e)]};
        for (int a = 0; a < 4; ++a) element.node[static_cast<std::size_t>(a)] = rest.nodes(a, e);
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t j = 0; j < 3; ++j)
                element.derivative[k][j] = float(rest.gradient(static_cast<Eigen::Index>(3 * k + j), e));
        elements_.push_back(element);
    }
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    set_state(zero, zero);
}

void ScalarSteps::set_state(const Matrix3Xd& displacement, const Matrix3Xd& increment) {
    require_columns(displacement.cols(), constrained_.cols(), "the displacement");
    require_columns(increment.cols(), constrained_.cols(), "the increment");
    displacement_ = vectors_of(constrained_.select(imposed_, displacement));
    increment_ = vectors_of(constrained_.select(Matrix3Xd::Zero(3, increment.cols()), increment));
}

void ScalarSteps::run(int steps, const StepCoefficients& coefficients) {
    for (int step = 0; step < steps; ++step) {
        add_element_forces();
        advance_nodes(float(coefficients.momentum), float(coefficients.gain));
    }
}

/// S = μ J^(−2/3) (I − tr C/3 C⁻¹) + κ J (J − 1) C⁻¹ of iso, S = μ (I − C⁻¹) + λ ln J C⁻¹ of lnJ, kPa.
Matrix ScalarSteps::stress(const NeoHookean& material, const Matrix& F) {
    const Matrix columns = transposed(F);
    const Matrix C = times_transposed(columns, columns);
    const Matrix adj = adjugate(C);
    const float J = F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
                    F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
                    F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
    float of_identity = material.shear;  // S = of_identity I + of_inverse C⁻¹
    float of_inverse = 0;
    if (material.isochoric) {
        const float root = std::cbrt(J);
        of_identity /= root * root;
        of_inverse = material.modulus * J * (J - 1) - of_identity * (C[0][0] + C[1][1] + C[2][2]) / 3;
    } else {
        of_inverse = material.modulus * std::log(J) - of_identity;
    }
    of_inverse /= J * J;  // C⁻¹ = adj C / J²
    Matrix S;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) S[i][j] = of_inverse * adj[i][j] + (i == j ? of_identity : 0.0F);
    return S;
}

/// Adds f_a = V F S ∂h_a of every element to the forces of its nodes; the fourth force is minus the sum of the others.
void ScalarSteps::add_element_forces() {
    for (const Element& element : elements_) {
        const Vector& u = displacement_[static_cast<std::size_t>(element.node[0])];
        Matrix F{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
        for (std::size_t k = 0; k < 3; ++k) {
            const Vector& of_node = displacement_[static_cast<std::size_t>(element.node[k + 1])];
            for (std::size_t i = 0; i < 3; ++i)
                for (std::size_t j = 0; j < 3; ++j) F[i][j] += (of_node[i] - u[i]) * element.derivative[k][j];
        }
        const Matrix S = stress(materials_[static_cast<std::size_t>(element.material)], F);
        const Matrix P = times_transposed(F, S);  // S is symmetric
        Vector& first = force_[static_cast<std::size_t>(element.node[0])];
        for (std::size_t k = 0; k < 3; ++k) {
            Vector& force = force_[static_cast<std::size_t>(element.node[k + 1])];
            const Vector& dh = element.derivative[k];
            for (std::size_t i = 0; i < 3; ++i) {
                const float f = element.volume * (P[i][0] * dh[0] + P[i][1] * dh[1] + P[i][2] * dh[2]);
                force[i] += f;
                first[i] -= f;
            }
        }
    }
}

/// Takes the forces and leaves zeros for the next step.
void ScalarSteps::advance_nodes(float momentum, float gain) {
    for (std::size_t a = 0; a < displacement_.size(); ++a)
        for (std::size_t i = 0; i < 3; ++i) {
            increment_[a][i] = momentum * increment_[a][i] - gain * inverse_mass_[a][i] * force_[a][i];
            displacement_[a][i] += increment_[a][i];
            force_[a][i] = 0;
        }
}

Matrix3Xd ScalarSteps::displacement() const {
    return matrix_of(displacement_);
}
Matrix3Xd ScalarSteps::increment() const {
    return matrix_of(increment_);
}

std::string ScalarSteps::description() const {
    return "CPU float32, scalar, 1 thread";
}

}  // namespace tissuewarp::tled
