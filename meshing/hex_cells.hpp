#pragma once
/// Hexahedral cells beside the tetrahedra of a mesh: both index the same nodes.

#include "meshing/tet_mesh.hpp"

#include <array>
#include <vector>

namespace tissuewarp::meshing {

using HexCorners = Eigen::Matrix<double, 3, 8>;

/// Hexahedra with a label each, corners in VTK's order: 0 1 2 3 around the bottom, 4 5 6 7 above them, so that
/// det[x1 − x0, x3 − x0, x4 − x0] > 0.
struct HexCells {
    Eigen::Matrix<int, 8, Eigen::Dynamic> hexes;  ///< 8 × M, node indices
    Eigen::VectorXi labels;                       ///< M, label of the tissue (> 0)

    [[nodiscard]] int count() const { return static_cast<int>(hexes.cols()); }
};

/// Tetrahedra (none, in a mesh of hexahedra alone) and hexahedra on the nodes of `mesh`.
struct MixedMesh {
    TetMesh mesh;
    HexCells hexahedra;
};

/// Corners of the six faces, right-hand normals outward: bottom, top, and the four sides.
inline constexpr std::array<std::array<int, 4>, 6> hex_faces{
    {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};

/// The surface of a face: bilinear between its four corners, or two triangles that meet in the diagonal between the
/// corners 0 and 2, or 1 and 3, of hex_faces.
enum class FaceShape { Bilinear, Diagonal02, Diagonal13 };
using FaceShapes = std::array<FaceShape, 6>;

/// The faces as the tetrahedra beside them cut them, bilinear where there are none: with triangles on one side and a
/// bilinear face on the other a mesh conforms in its nodes alone, and constant stresses would not balance.
std::vector<FaceShapes> face_shapes(const TetMesh& mesh, const HexCells& cells);

HexCorners hex_corners(const Eigen::Matrix3Xd& nodes, const HexCells& cells, int hex);

/// B_iI = ∮ N_I n_i dA over the surface, 3 × 8, mm²: V times the mean of ∂N_I/∂x_i (Flanagan and Belytschko 1981, eq.
/// 14, whose bilinear faces it has by default). Σ_I B_iI = 0 and Σ_I B_iI x_jI = V δ_ij for faces of either shape.
HexCorners surface_gradient(const HexCorners& corners, const FaceShapes& faces = {});

/// Volume within bilinear faces, mm³.
Eigen::VectorXd hex_volumes(const Eigen::Matrix3Xd& nodes, const HexCells& cells);

/// Of each hexahedron the smallest determinant of the three edges at a corner over the product of their lengths: 1 for
/// a brick, ≤ 0 for a hexahedron that is folded or flat somewhere.
Eigen::VectorXd scaled_jacobians(const Eigen::Matrix3Xd& nodes, const HexCells& cells);

/// Throws InvalidInput unless indices are in range, coordinates finite, scaled Jacobians positive and labels > 0.
void require_valid(const Eigen::Matrix3Xd& nodes, const HexCells& cells, const char* name);

}  // namespace tissuewarp::meshing
