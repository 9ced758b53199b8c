#include "registration/field/gpu_warp_layout.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Geometry;

/// Rows of voxels that a portion of an element has at most, so that one long element does not keep 32 lanes busy while
/// the others rest.
constexpr int rows_of_portion = 512;

std::array<Float4, 3> rows_of(const Row4& matrix) {
    std::array<Float4, 3> rows;
    for (int r = 0; r < 3; ++r)
        rows[static_cast<std::size_t>(r)] = packed(matrix.row(r).head<3>().transpose(), matrix(r, 3));
    return rows;
}

}  // namespace

Geometry before_placement(const Geometry& output, const Eigen::Isometry3d& placement) {
    const Eigen::Isometry3d to_moving = placement.inverse();
    Geometry grid = output;
    grid.origin = to_moving * output.origin;
    grid.direction = to_moving.linear() * output.direction;
    return grid;
}

Row4 rigid_field(const Geometry& output, const Eigen::Isometry3d& placement) {
    const Geometry grid = before_placement(output, placement);
    Row4 rows;
    rows << grid.index_to_point() - output.index_to_point(), grid.origin - output.origin;
    return rows;
}

GridBlock grid_block(const Geometry& moving, const Geometry& output, const Eigen::Isometry3d& placement) {
    const Geometry grid = before_placement(output, placement);
    const Eigen::Matrix3d to_index = moving.point_to_index();
    Row4 offset, matrix;
    offset << to_index * grid.index_to_point() - Eigen::Matrix3d::Identity(), moving.index(grid.origin);
    matrix << to_index, Eigen::Vector3d::Zero();
    return {packed(output.size), packed(moving.size), rows_of(offset), rows_of(rigid_field(output, placement)),
            rows_of(matrix)};
}

void set_node_words(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix3Xd& displacement, const Geometry& output,
                    const Eigen::Isometry3d& placement, std::vector<Float4>& words) {
    const Geometry seen = before_placement(output, placement);
    const Eigen::Matrix3d to_index = seen.point_to_index();
    words.resize(2 * static_cast<std::size_t>(nodes.cols()));
    for (Eigen::Index n = 0; n < nodes.cols(); ++n) {
        const Eigen::Vector3d u = displacement.col(n);
        const Eigen::Vector3d index = to_index * (nodes.col(n) + u - seen.origin);
        words[2 * static_cast<std::size_t>(n)] = packed(index);
        words[2 * static_cast<std::size_t>(n) + 1] = packed(-u);
    }
}

std::vector<Uint4> portions_of(const meshing::TetMesh& mesh, const Geometry& output) {
    const Eigen::Matrix3Xd index = output.point_to_index() * mesh.nodes;
    std::vector<Uint4> portions;
    for (int e = 0; e < mesh.tet_count(); ++e) {
        const Eigen::Matrix<double, 3, 4> corners = index(Eigen::all, mesh.tets.col(e));
        const Eigen::Array3d extent = corners.rowwise().maxCoeff() - corners.rowwise().minCoeff();
        const double rows = std::min(extent[1] + 1.0, 1.0 * output.size[1]) *  //
                            std::min(extent[2] + 1.0, 1.0 * output.size[2]);
        const auto count = static_cast<std::uint32_t>(rows / rows_of_portion) + 1;
        for (std::uint32_t part = 0; part < count; ++part)
            portions.push_back({static_cast<std::uint32_t>(e), part, count, 0});
    }
    return portions;
}

std::vector<Uint4> corners_of(const meshing::TetMesh& mesh) {
    std::vector<Uint4> corners;
    for (const auto& tet : mesh.tets.colwise())
        corners.push_back({static_cast<std::uint32_t>(tet[0]), static_cast<std::uint32_t>(tet[1]),
                           static_cast<std::uint32_t>(tet[2]), static_cast<std::uint32_t>(tet[3])});
    return corners;
}

}  // namespace tissuewarp::registration::detail
