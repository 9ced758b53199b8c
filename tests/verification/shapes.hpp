#pragma once
/// Structured meshes mapped onto the shapes of the problems.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Core>

#include <array>
#include <functional>
#include <vector>

namespace tissuewarp::verification {

/// 0 … length in `cells` cells that shrink towards 0 as t^grading.
std::vector<double> graded(double length, int cells, double grading);

/// The same with cells that shrink towards `length`.
std::vector<double> graded_up(double length, int cells, double grading);

/// The same towards both ends.
std::vector<double> graded_both_ways(double length, int cells, double grading);

/// box_mesh between the planes with every cell's long diagonal pointing away from the origin: symmetric in the planes
/// of coordinates, which must be among the given ones where the box lies on both sides.
meshing::TetMesh symmetric_box(const std::array<std::vector<double>, 3>& coordinates);

/// Polar angles (from +z) of the circles on the unit sphere onto which the edges of the top and the bottom face of the
/// cube [−1, 1]³ are mapped, so that a mesh follows the rims of two patches.
struct Rims {
    double top, bottom;
};

/// Point of the unit sphere for a point of the cube's surface.
Eigen::Vector3d sphere_point(const Eigen::Vector3d& on_cube, const Rims& rims);

/// Point of the unit ball: along the ray of sphere_point, as far as the largest coordinate says. Cells at the rims have
/// an angle of nearly 180° there, which the diagonals of symmetric_box cut in two.
Eigen::Vector3d ball_point(const Eigen::Vector3d& in_cube, const Rims& rims);

}  // namespace tissuewarp::verification
