#pragma once
/// What a static solver needs to know of a discretisation: its energy in the nodal displacements and two derivatives.

#include "tled/rest_state.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled {

namespace detail {
struct BlockRows;  // tled/stiffness/stiffness.hpp
}

/// E(u) of nodal displacements u (3 × N mm). Implementations: LinearTetrahedra, QuadraticTetrahedra.
class DiscreteEnergy {
public:
    DiscreteEnergy() = default;
    DiscreteEnergy(const DiscreteEnergy&) = delete;
    DiscreteEnergy& operator=(const DiscreteEnergy&) = delete;
    virtual ~DiscreteEnergy() = default;

    [[nodiscard]] virtual int node_count() const = 0;

    /// E, mN·mm; +∞ where det F ≤ 0 somewhere, so that line searches turn back.
    [[nodiscard]] virtual double energy(const Eigen::Matrix3Xd& u) const = 0;

    /// ∂E/∂u, mN, 3 × N. Throws SolverFailure where det F ≤ 0.
    [[nodiscard]] virtual Eigen::Matrix3Xd force(const Eigen::Matrix3Xd& u) const = 0;

    /// ∂²E/∂u², mN/mm, its lower triangle: row i holds the blocks (i, j) with j ≥ i; the same pattern for every u.
    /// Throws SolverFailure where det F ≤ 0.
    [[nodiscard]] virtual detail::BlockRows stiffness(const Eigen::Matrix3Xd& u) const = 0;

    /// det F wherever the energy evaluates it, element by element in the order of the mesh.
    [[nodiscard]] virtual Eigen::VectorXd jacobians(const Eigen::Matrix3Xd& u) const = 0;

    /// How many of these each element has.
    [[nodiscard]] virtual int jacobians_per_element() const = 0;
};

/// The smallest det F and the element of the mesh that holds it.
struct ElementJacobian {
    double value = 1.0;
    int element = -1;
};
ElementJacobian smallest_element_jacobian(const DiscreteEnergy& energy, const Eigen::Matrix3Xd& u);

/// The elements of a RestState, linear tetrahedra with or without averaged pressure: the functions of
/// tled/model/internal_force.hpp.
class LinearTetrahedra final : public DiscreteEnergy {
public:
    /// Keeps a reference: `rest` must outlive this object.
    explicit LinearTetrahedra(const RestState& rest) : rest_(rest) {}

    [[nodiscard]] int node_count() const override { return rest_.node_count; }
    [[nodiscard]] double energy(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] Eigen::Matrix3Xd force(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] detail::BlockRows stiffness(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] Eigen::VectorXd jacobians(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] int jacobians_per_element() const override { return 1; }

private:
    const RestState& rest_;
};

}  // namespace tissuewarp::tled
