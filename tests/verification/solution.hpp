#pragma once
/// A problem solved on one mesh with one element.

#include "tests/verification/problem.hpp"
#include "tled/model.hpp"
#include "tled/reference/quadratic.hpp"

#include <functional>
#include <memory>
#include <optional>

namespace tissuewarp::verification {

enum class Elements {
    T4,
    AveragedPressure,
    Quadratic,       ///< T10, pressure in the elements
    QuadraticMixed,  ///< T10 with a linear continuous pressure
};
const char* name_of(Elements elements);
inline bool is_quadratic(Elements elements) {
    return elements == Elements::Quadratic || elements == Elements::QuadraticMixed;
}

/// Fields of one solution. Sums are over the part that was solved: quantities multiply by the number of parts.
class Solution {
public:
    meshing::TetMesh mesh;                      ///< of the corners
    std::optional<tled::QuadraticMesh> curved;  ///< with middle nodes, for T10
    Eigen::Matrix3Xd displacement, force;       ///< u (mm) and ∂E/∂u (mN) of all nodes
    double energy = 0;                          ///< mN mm
    double min_jacobian = 0;
    int iterations = 0;

    [[nodiscard]] const Eigen::Matrix3Xd& nodes() const { return curved ? curved->nodes : mesh.nodes; }
    /// Displacement at a rest position of the body; outside the mesh, that of the nearest element continued.
    [[nodiscard]] Eigen::Vector3d at(const Eigen::Vector3d& X) const;
    /// Sum of the elastic nodal forces over the nodes whose rest position satisfies `on`: what holds the body there.
    [[nodiscard]] Eigen::Vector3d reaction(const std::function<bool(const Eigen::Vector3d&)>& on) const;
    /// Nodes whose rest position satisfies `on`.
    [[nodiscard]] std::vector<int> nodes_on(const std::function<bool(const Eigen::Vector3d&)>& on) const;
    /// Volume enclosed by the deformed mesh, mm³.
    [[nodiscard]] double deformed_volume() const;
};

/// The problem's tissue in linear elements.
tled::Model linear_model(const Problem& problem, Elements elements, const meshing::TetMesh& mesh);

/// Loads and prescribed displacements of the last stage on linear elements, without contact.
tled::NodalConditions nodal_conditions_of(const Problem& problem, const meshing::TetMesh& mesh);

/// Newton's method, in the stages of the problem; with a rigid plane, by an exact nodal active set around it.
Solution solve(const Problem& problem, Elements elements, int level);

}  // namespace tissuewarp::verification
