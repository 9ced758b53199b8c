#pragma once
/// Where quadratic tetrahedra lie, and the exact map that they define.

#include "meshing/point_location.hpp"
#include "tled/reference/quadratic.hpp"

#include <Eigen/Core>

#include <optional>

namespace tissuewarp::study::detail {

/// Quadratic tetrahedra cut into 64 straight ones each, for finding the element that holds a point.
class FineTetrahedra {
public:
    /// `nodes` of the mesh, at rest or deformed, 3 × N mm.
    FineTetrahedra(const tled::QuadraticMesh& mesh, const Eigen::Matrix3Xd& nodes);

    struct Place {
        int element = -1;
        Eigen::Vector3d local = Eigen::Vector3d::Zero();  ///< coordinates of the unit tetrahedron
    };
    /// Exact to the curvature of an edge over four; nothing outside.
    [[nodiscard]] std::optional<Place> find(const Eigen::Vector3d& point) const;

private:
    meshing::PointLocator locator_;
};

/// x(X) = X + Σ N_i(ξ) u_i, where X(ξ) = X.
class QuadraticMap {
public:
    /// `displacement`: 3 × N mm.
    QuadraticMap(tled::QuadraticMesh mesh, Eigen::Matrix3Xd displacement);

    /// Of a rest position, mm; nothing outside the mesh.
    [[nodiscard]] std::optional<Eigen::Vector3d> operator()(const Eigen::Vector3d& point) const;

private:
    tled::QuadraticMesh mesh_;
    Eigen::Matrix3Xd displacement_;
    FineTetrahedra places_;
};

}  // namespace tissuewarp::study::detail
