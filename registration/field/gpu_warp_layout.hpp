#pragma once
/// The arrays that the kernels of the warp read (contracts in shaders/chunks/warp*.glsl, shaders/kernels/warp_*.comp).

#include "imaging/geometry.hpp"
#include "meshing/tet_mesh.hpp"
#include "registration/field/gpu_words.hpp"

#include <Eigen/Geometry>

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

using Row4 = Eigen::Matrix<double, 3, 4>;

/// The storage block WarpGrid.
struct GridBlock {
    Uint4 output_size, moving_size;
    std::array<Float4, 3> rigid_offset, rigid_field, to_moving_index;
};
GridBlock grid_block(const imaging::Geometry& moving, const imaging::Geometry& output,
                     const Eigen::Isometry3d& placement);

/// The storage block WarpCounts.
struct ElementCounts {
    std::uint32_t negative = 0, flat = 0;
};

/// The output grid seen from the moving frame.
imaging::Geometry before_placement(const imaging::Geometry& output, const Eigen::Isometry3d& placement);

/// X − y, mm, of tissue that the placement alone has moved, as an affine function of the output index.
Row4 rigid_field(const imaging::Geometry& output, const Eigen::Isometry3d& placement);

/// Two entries a node: its deformed position as an output index, reduced in double precision, and −u, mm. Every element
/// that shares a node sees the same rounded position, so rounding opens no gap.
void set_node_words(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix3Xd& displacement,
                    const imaging::Geometry& output, const Eigen::Isometry3d& placement, std::vector<Float4>& words);

/// (element, portion, portions of that element), from the boxes around the elements at rest; a deformation that grows
/// them costs balance, not voxels.
std::vector<Uint4> portions_of(const meshing::TetMesh& mesh, const imaging::Geometry& output);

std::vector<Uint4> corners_of(const meshing::TetMesh& mesh);

}  // namespace tissuewarp::registration::detail
