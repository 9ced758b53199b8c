#pragma once
/// Data on points inside elements, as springs on nodes.

#include "meshing/point_location.hpp"
#include "tled/conditions.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <span>
#include <vector>

namespace tissuewarp::registration::detail {

/// Energy ½ (u(X) − target)ᵀ K (u(X) − target) of the displacement at a point of the tissue.
struct Pull {
    meshing::Location at;
    Eigen::Vector3d target = Eigen::Vector3d::Zero();     ///< displacement, mm, moving frame
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero();  ///< K, mN/mm, symmetric positive semi-definite
};

struct PlaceOptions {
    /// How far outside of the mesh a point may lie, as the least barycentric coordinate, one after the other: the
    /// nearest element first. Half an element: data on a surface lie beside the mesh. Chosen by hand; on which data is
    /// not recorded.
    std::array<double, 4> outside{1e-9, 0.1, 0.25, 0.5};
};
inline constexpr PlaceOptions place_options{};

/// The place in the mesh of a point in it, or of one up to about half an element outside, drawn to the surface.
std::optional<meshing::Location> locate_near(const meshing::PointLocator& locator, const Eigen::Vector3d& point);

/// Displacement (3 × N nodal) at a place in the mesh, mm.
Eigen::Vector3d displacement_at(const meshing::TetMesh& mesh, const Eigen::Matrix3Xd& displacement,
                                const meshing::Location& at);

/// What a pull is at some displacement u.
struct PullForce {
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero();  ///< K, mN/mm
    Eigen::Vector3d force = Eigen::Vector3d::Zero();      ///< K (target − u(X)), mN
};

/// By which weights places pull on which nodes. Made once for places that stay.
class NodalShares {
public:
    struct Share {
        int place = 0;
        double weight = 0;  ///< barycentric
    };

    NodalShares() = default;
    NodalShares(const meshing::TetMesh& mesh, std::span<const meshing::Location> places);

    /// Nodes that have shares, ascending.
    [[nodiscard]] const std::vector<int>& nodes() const { return nodes_; }
    /// Those of one of them, by its place in nodes(); in the order of the places.
    [[nodiscard]] std::span<const Share> of(std::size_t n) const {
        return std::span(shares_).subspan(first_[n], first_[n + 1] - first_[n]);
    }

private:
    std::vector<int> nodes_;
    std::vector<std::size_t> first_;  // in shares_, of each of nodes_, and the end
    std::vector<Share> shares_;
};

/// Springs on the nodes with the pulls' forces at `displacement` (3 × N, mm) and a stiffness not below theirs: node a
/// gets K_a = Σ w_a K and the target u_a + K_a⁻¹ Σ w_a K (target − u(X)), w its barycentric weights. By Jensen's
/// inequality Σ_a w_a ‖u_a‖²_K ≥ ‖u(X)‖²_K: equilibria under springs renewed at the equilibrium before lower the
/// energy of tissue and pulls each time and end where the pulls' own forces balance (majorise-minimise).
std::vector<tled::Spring> lumped_springs(const meshing::TetMesh& mesh, const std::vector<Pull>& pulls,
                                         const Eigen::Matrix3Xd& displacement);
/// The same of pulls at the places of `shares`.
std::vector<tled::Spring> lumped_springs(const NodalShares& shares, std::span<const PullForce> pulls,
                                         const Eigen::Matrix3Xd& displacement);

}  // namespace tissuewarp::registration::detail
