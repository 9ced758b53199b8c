#pragma once
/// Ten-node tetrahedra for the implicit reference solver: the truth that coarser elements are compared with. Bathe,
/// Finite Element Procedures (2014), section 5.3.2 (shape functions), 4.4.3 (displacement–pressure elements).

#include "meshing/tet_mesh.hpp"
#include "tled/material.hpp"
#include "tled/reference/discrete_energy.hpp"

#include <Eigen/Core>

#include <array>
#include <functional>
#include <map>
#include <utility>
#include <vector>

namespace tissuewarp::tled {

namespace detail {
struct RankOneRows;  // tled/stiffness/stiffness.hpp
}

/// Tetrahedra with a node in the middle of every edge.
struct QuadraticMesh {
    Eigen::Matrix3Xd nodes;                       ///< 3 × N, mm: the corners as in the linear mesh, then the middles
    Eigen::Matrix<int, 10, Eigen::Dynamic> tets;  ///< corners 0–3, then the middles of 01, 12, 02, 03, 13, 23
    Eigen::VectorXi labels;                       ///< of every tetrahedron
    std::map<std::pair<int, int>, int> middle;    ///< edge (smaller corner first) → its middle node
    int corner_count = 0;

    [[nodiscard]] int node_count() const { return static_cast<int>(nodes.cols()); }
    [[nodiscard]] int tet_count() const { return static_cast<int>(tets.cols()); }
};

/// Where the middle node between two corners a and b (mm) lies.
using EdgeCurve = std::function<Eigen::Vector3d(const Eigen::Vector3d& a, const Eigen::Vector3d& b)>;

/// Middles on straight edges, except on the boundary and on interfaces between labels where `curve` is given.
QuadraticMesh quadratic_mesh(const meshing::TetMesh& mesh, const EdgeCurve& curve = {});

/// Shape functions (10) and their derivatives by the local coordinates (10 × 3) at local coordinates of the unit
/// tetrahedron.
Eigen::Matrix<double, 10, 1> quadratic_shape(const Eigen::Vector3d& local);
Eigen::Matrix<double, 10, 3> quadratic_shape_derivatives(const Eigen::Vector3d& local);

/// Points per element: exact for polynomials of degree 2, 3 and 4. The rules of five and eleven points hold one
/// negative weight (Keast 1986). Homogeneous states of elements with curved edges need degree 3.
enum class Quadrature { Points4, Points5, Points11 };

/// How the volumetric energy M U(J) is evaluated.
enum class QuadraticPressure {
    Pointwise,  ///< at every quadrature point: third order while ν is moderate
    NodalAverage  ///< of J averaged at the corners, J_a = ∫ L_a J / ∫ L_a with the linear L_a: as ν → ½ the Taylor–Hood
                  ///< element, which does not lock. Averages do not cross labels.
};

struct QuadraticOptions {
    Quadrature quadrature = Quadrature::Points4;
    QuadraticPressure pressure = QuadraticPressure::Pointwise;
};

class QuadraticTetrahedra final : public DiscreteEnergy {
public:
    /// Throws InvalidInput where a label has no material or a quadrature point of an element has no positive volume.
    QuadraticTetrahedra(const QuadraticMesh& mesh, const MaterialTable& materials,
                        const QuadraticOptions& options = {});

    [[nodiscard]] int node_count() const override { return node_count_; }
    [[nodiscard]] double energy(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] Eigen::Matrix3Xd force(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] detail::BlockRows stiffness(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] Eigen::VectorXd jacobians(const Eigen::Matrix3Xd& u) const override;
    [[nodiscard]] int jacobians_per_element() const override { return points_; }

private:
    using Gradients = Eigen::Matrix<double, 3, 10>;
    using ElementMatrix = Eigen::Matrix<double, 30, 30>;

    /// One (corner, label) of the averaged J.
    struct PressureNode {
        double volume = 0;  // ∫ L_a, mm³
        Material material;
        std::vector<std::pair<int, int>> elements;  // (element, corner)
    };

    void locate_points(const QuadraticMesh& mesh, Quadrature quadrature);
    void build_pressure_nodes(const QuadraticMesh& mesh, const MaterialTable& materials);
    void build_pattern();
    [[nodiscard]] Eigen::Matrix3d deformation_gradient(const Eigen::Matrix3Xd& u, int element, int point) const;
    [[nodiscard]] Eigen::VectorXd checked_jacobians(const Eigen::Matrix3Xd& u) const;
    [[nodiscard]] double nodal_jacobian(int a, const Eigen::VectorXd& J) const;
    /// M U'(J_a) at every pressure node, kPa.
    [[nodiscard]] Eigen::VectorXd nodal_pressure(const Eigen::VectorXd& J) const;
    /// M U' at a quadrature point, kPa.
    [[nodiscard]] double pressure_at(int element, int point, double J, const Eigen::VectorXd& nodal) const;
    [[nodiscard]] ElementMatrix element_matrix(const Eigen::Matrix3Xd& u, int element, const Eigen::VectorXd& J,
                                               const Eigen::VectorXd& nodal) const;
    void add_element_matrices(const Eigen::Matrix3Xd& u, const Eigen::VectorXd& J, const Eigen::VectorXd& nodal,
                              detail::BlockRows& rows) const;
    void add_pressure_rows(const Eigen::Matrix3Xd& u, const Eigen::VectorXd& J, detail::RankOneRows& rows) const;

    int node_count_ = 0, points_ = 0;
    Eigen::Matrix<int, 10, Eigen::Dynamic> tets_;
    std::vector<Material> material_;    // of every element
    std::vector<Eigen::Vector4d> hat_;  // L_0 … L_3 at every point
    std::vector<Gradients> gradient_;   // ∇N, 1/mm, element by element
    Eigen::VectorXd weight_;            // mm³, element by element
    QuadraticPressure pressure_ = QuadraticPressure::Pointwise;
    std::vector<PressureNode> pressure_nodes_;
    Eigen::Matrix4Xi pressure_node_of_;         // of every element's corners
    std::vector<int> row_offset_, row_column_;  // node → nodes of its elements, ascending
};

/// Consistent nodal forces (mN, 3 × N) of a body force (mN/mm³ of rest volume).
Eigen::Matrix3Xd body_load(const QuadraticMesh& mesh, const Eigen::Vector3d& body_force);

/// Consistent nodal forces (mN, 3 × N) of a dead traction (kPa of rest area) on the face of three corners.
void add_traction(const QuadraticMesh& mesh, const std::array<int, 3>& face, const Eigen::Vector3d& traction,
                  Eigen::Matrix3Xd& load);

}  // namespace tissuewarp::tled
