#pragma once
/// The step of total Lagrangian explicit dynamics as its authors ran it on one processor (Miller et al. 2007; the CPU
/// version of Taylor, Cheng, Ourselin 2007): plain loops, one thread, float32. What the engines of engine.hpp are
/// timed against.

#include "tled/conditions.hpp"
#include "tled/engine.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace tissuewarp::tled {

/// Linear tetrahedra of neo-Hookean materials (iso and lnJ), imposed displacements. State: displacement u and
/// increment u − u⁻ (3 × N, mm).
class ScalarSteps {
public:
    /// Of the conditions `constrained` and `imposed` are taken; `mass` is diagonal, 3 × N, kg. The state is zero but
    /// for what is imposed. Throws InvalidInput for what the loops do not know (another law, averaged pressure,
    /// viscosity, springs, external forces), for wrong shapes and for masses that are not positive.
    ScalarSteps(const RestState& rest, const NodalConditions& conditions, const Eigen::Matrix3Xd& mass);

    /// Imposed components keep their imposed displacement and increment zero. Throws InvalidInput for wrong shapes.
    void set_state(const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& increment);
    void run(int steps, const StepCoefficients& coefficients);

    [[nodiscard]] Eigen::Matrix3Xd displacement() const;
    [[nodiscard]] Eigen::Matrix3Xd increment() const;
    /// For reports: "CPU float32, scalar, 1 thread".
    [[nodiscard]] std::string description() const;

private:
    using Vector = std::array<float, 3>;
    using Matrix = std::array<Vector, 3>;  ///< by rows

    struct Element {
        std::array<int, 4> node;
        Matrix derivative;  ///< row k: ∂h_{k+1}/∂X of the three shape functions that are kept, 1/mm
        float volume;       ///< mm³
        int material;
    };
    struct NeoHookean {
        bool isochoric;        ///< iso, otherwise lnJ
        float shear, modulus;  ///< μ; κ of iso, λ of lnJ; kPa
    };

    void add_element_forces();
    void advance_nodes(float momentum, float gain);
    [[nodiscard]] static Matrix stress(const NeoHookean& material, const Matrix& F);

    std::vector<Element> elements_;
    std::vector<NeoHookean> materials_;
    std::vector<Vector> displacement_, increment_, force_, inverse_mass_;  ///< of nodes
    Eigen::Matrix<bool, 3, Eigen::Dynamic> constrained_;
    Eigen::Matrix3Xd imposed_;
};

}  // namespace tissuewarp::tled
