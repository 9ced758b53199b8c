#include "meshing/point_location.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace tissuewarp::meshing {

namespace {

using Box = std::array<Eigen::Array3i, 2>;  // first and last cell

Eigen::Array3i cell_of(const Eigen::Array3d& grid_position, const std::array<int, 3>& cells) {
    Eigen::Array3i cell;
    for (int axis = 0; axis < 3; ++axis)
        cell[axis] = static_cast<int>(std::clamp(std::floor(grid_position[axis]), 0.0, cells[axis] - 1.0));
    return cell;
}

template <class Visit>
void for_each_cell(const Box& box, const std::array<int, 3>& cells, const Visit& visit) {
    for (int k = box[0][2]; k <= box[1][2]; ++k)
        for (int j = box[0][1]; j <= box[1][1]; ++j)
            for (int i = box[0][0]; i <= box[1][0]; ++i)
                visit(static_cast<std::size_t>(i) +
                      static_cast<std::size_t>(cells[0]) *
                          (static_cast<std::size_t>(j) +
                           static_cast<std::size_t>(cells[1]) * static_cast<std::size_t>(k)));
}

}  // namespace

PointLocator::PointLocator(const TetMesh& mesh) {
    require_valid(mesh, "point locator");
    const Eigen::Index count = mesh.tets.cols();
    tets_.reserve(static_cast<std::size_t>(count));
    Eigen::Array3Xd lower(3, count), upper(3, count);
    for (Eigen::Index t = 0; t < count; ++t) {
        const Eigen::Matrix<double, 3, 4> corners = mesh.nodes(Eigen::all, mesh.tets.col(t));
        const Eigen::Matrix3d edges = corners.rightCols<3>().colwise() - corners.col(0);
        tets_.push_back({corners.col(0), edges.inverse()});
        lower.col(t) = corners.rowwise().minCoeff();
        upper.col(t) = corners.rowwise().maxCoeff();
    }
    lower_ = lower.rowwise().minCoeff();
    reach_ = (upper - lower).rowwise().maxCoeff();
    // Cells of about the mean extent of a tetrahedron: each tetrahedron meets a handful of cells, each cell a handful
    // of tetrahedra. The bound of 2 cells per tetrahedron keeps thin or scattered meshes from exhausting memory.
    const Eigen::Array3d extent = upper.rowwise().maxCoeff() - lower_.array();
    const double mean = std::max((upper - lower).mean(), 1e-12 * extent.maxCoeff());
    const double bound = std::cbrt(extent.max(mean).prod() / (2.0 * static_cast<double>(count) + 64.0));
    const double side = std::max(mean, bound);
    for (int axis = 0; axis < 3; ++axis) cells_[axis] = static_cast<int>(std::floor(extent[axis] / side)) + 1;
    cell_ = Eigen::Vector3d::Constant(side);

    const auto box_of = [&](Eigen::Index t) -> Box {
        return {cell_of((lower.col(t) - lower_.array()) / cell_.array(), cells_),
                cell_of((upper.col(t) - lower_.array()) / cell_.array(), cells_)};
    };
    const std::size_t cell_count =
        static_cast<std::size_t>(cells_[0]) * static_cast<std::size_t>(cells_[1]) * static_cast<std::size_t>(cells_[2]);
    offset_.assign(cell_count + 1, 0);
    for (Eigen::Index t = 0; t < count; ++t)
        for_each_cell(box_of(t), cells_, [&](std::size_t cell) { ++offset_[cell + 1]; });
    for (std::size_t cell = 0; cell < cell_count; ++cell) offset_[cell + 1] += offset_[cell];
    entry_.resize(static_cast<std::size_t>(offset_.back()));
    std::vector<int> next(offset_.begin(), offset_.end() - 1);
    for (Eigen::Index t = 0; t < count; ++t)
        for_each_cell(box_of(t), cells_,
                      [&](std::size_t cell) { entry_[static_cast<std::size_t>(next[cell]++)] = static_cast<int>(t); });
}

std::optional<Location> PointLocator::find(const Eigen::Vector3d& point, double tolerance) const {
    // {λ ≥ −ε} is the tetrahedron grown by 1 + 4 ε about its centroid, at most 3 ε of its extent beyond its box.
    const Eigen::Array3d margin = 3.0 * std::max(tolerance, 1e-9) * reach_.array();
    const Eigen::Array3d from = (point.array() - margin - lower_.array()) / cell_.array();
    const Eigen::Array3d to = (point.array() + margin - lower_.array()) / cell_.array();
    for (int axis = 0; axis < 3; ++axis)
        if (!(to[axis] >= 0.0 && from[axis] <= cells_[axis])) return std::nullopt;  // also when not finite

    Location best;
    for_each_cell({cell_of(from, cells_), cell_of(to, cells_)}, cells_, [&](std::size_t cell) {
        for (int e = offset_[cell]; e < offset_[cell + 1]; ++e) {
            const int tet = entry_[static_cast<std::size_t>(e)];
            if (best.tet >= 0 && tet >= best.tet) break;  // entries ascend
            const auto& [corner, inverse] = tets_[static_cast<std::size_t>(tet)];
            Eigen::Vector4d weights;
            weights.tail<3>().noalias() = inverse * (point - corner);
            weights[0] = 1.0 - weights.tail<3>().sum();
            if (weights.minCoeff() >= -tolerance) best = {tet, weights};
        }
    });
    if (best.tet < 0) return std::nullopt;
    return best;
}

Eigen::VectorXd interpolate(const TetMesh& mesh, const Eigen::MatrixXd& nodal, const Location& location) {
    return nodal(Eigen::all, mesh.tets.col(location.tet)) * location.barycentric;
}

}  // namespace tissuewarp::meshing
