#pragma once
/// Quadrature on the unit tetrahedron and triangle. Keast, Moderate-degree tetrahedral quadrature formulas (1986);
/// Dunavant, High degree efficient symmetrical Gaussian quadrature rules for the triangle (1985).

#include "tled/reference/quadratic.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// Weights sum to the volume 1/6.
struct QuadraturePoint {
    Eigen::Vector3d local;
    double weight;
};
std::vector<QuadraturePoint> tetrahedron_rule(Quadrature quadrature);

/// Weights sum to the area 1/2.
struct TrianglePoint {
    Eigen::Vector3d barycentric;
    double weight;
};
/// Six points, exact for degree 4.
std::vector<TrianglePoint> triangle_rule();

}  // namespace tissuewarp::tled::detail
