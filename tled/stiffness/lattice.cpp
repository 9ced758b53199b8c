#include "tled/stiffness/lattice.hpp"

#include "tled/parallel/parallel.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <unordered_map>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

using Index3 = Eigen::Matrix<int, 3, 1>;

/// Numbers of places on a grid, in the order in which they are asked for.
class Numbering {
public:
    int of(const Index3& place) {
        const std::int64_t key = (std::int64_t(place[2]) * stride + place[1]) * stride + place[0];
        return number_.emplace(key, static_cast<int>(number_.size())).first->second;
    }
    [[nodiscard]] int count() const { return static_cast<int>(number_.size()); }

private:
    static constexpr std::int64_t stride = 1 << 20;
    std::unordered_map<std::int64_t, int> number_;
};

/// Of nodes from a corner of the lattice, in edges.
Index3 cell_of(const Vector3d& place) {
    return place.array().floor().cast<int>();
}

Index3 corner_of(int k) {
    return {k & 1, k >> 1 & 1, k >> 2};
}

int occupied(const Matrix3Xd& nodes, const Vector3d& origin, double edge) {
    Numbering cells;
    for (const auto& X : nodes.colwise()) cells.of(cell_of((X - origin) / edge));
    return cells.count();
}

/// So that about `cells` cells hold nodes, of which flat and thin bodies fill another share of their box than balls.
double edge_for(const Matrix3Xd& nodes, const Vector3d& origin, const Vector3d& size, int cells) {
    double edge = std::cbrt(size.cwiseMax(1e-3 * size.maxCoeff()).prod() / cells);
    for (int round = 0; round < 4; ++round) edge *= std::cbrt(double(occupied(nodes, origin, edge)) / cells);
    return edge;
}

/// What one cell adds to the rows of its corners: 24 × 3 per point that it touches.
struct Share {
    std::vector<int> touched;  // ascending
    MatrixXd blocks;
};

/// Cells to the places of their corners among the points that are touched.
using Places = std::map<int, std::array<int, 8>>;

Places places_of(const Lattice& lattice, const BlockRows& K, int cell, std::vector<int>& touched) {
    Places places;
    for (int n = lattice.offset[cell]; n < lattice.offset[cell + 1]; ++n) {
        const int i = lattice.node[n];
        for (int k = K.offset[i]; k < K.offset[i + 1]; ++k) places[lattice.cell[K.column[k]]];
    }
    for (const auto& [other, place] : places)
        touched.insert(touched.end(), lattice.corner.col(other).begin(), lattice.corner.col(other).end());
    std::sort(touched.begin(), touched.end());
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    for (auto& [other, place] : places)
        for (int b = 0; b < 8; ++b)
            place[b] = static_cast<int>(std::lower_bound(touched.begin(), touched.end(), lattice.corner(b, other)) -
                                        touched.begin());
    return places;
}

Share share_of(const Lattice& lattice, const BlockRows& K, int cell) {
    Share share;
    const Places places = places_of(lattice, K, cell, share.touched);
    const auto width = 3 * static_cast<Eigen::Index>(share.touched.size());
    share.blocks = MatrixXd::Zero(24, width);
    Matrix3Xd row(3, width);  // of K P
    for (int n = lattice.offset[cell]; n < lattice.offset[cell + 1]; ++n) {
        const int i = lattice.node[n];
        row.setZero();
        for (int k = K.offset[i]; k < K.offset[i + 1]; ++k) {
            const int j = K.column[k];
            const std::array<int, 8>& place = places.at(lattice.cell[j]);
            for (int b = 0; b < 8; ++b) row.middleCols<3>(3 * place[b]) += lattice.weight(b, j) * K.block[k];
        }
        for (int a = 0; a < 8; ++a) share.blocks.middleRows<3>(3 * a) += lattice.weight(a, i) * row;
    }
    return share;
}

/// Cells about every point, with which of their corners it is.
std::vector<std::vector<std::pair<int, int>>> cells_about(const Lattice& lattice) {
    std::vector<std::vector<std::pair<int, int>>> about(lattice.point_count);
    for (int cell = 0; cell < lattice.cell_count(); ++cell)
        for (int a = 0; a < 8; ++a) about[lattice.corner(a, cell)].emplace_back(cell, a);
    return about;
}

}  // namespace

Lattice lattice_about(const Matrix3Xd& nodes, int cells) {
    const Vector3d least = nodes.rowwise().minCoeff(), size = Vector3d(nodes.rowwise().maxCoeff()) - least;
    Lattice lattice;
    lattice.edge_mm = edge_for(nodes, least, size, cells);
    Numbering cell_numbers, point_numbers;
    std::vector<Index3> place;
    lattice.weight.resize(8, nodes.cols());
    for (Eigen::Index i = 0; i < nodes.cols(); ++i) {
        const Vector3d X = (nodes.col(i) - least) / lattice.edge_mm;
        const Index3 at = cell_of(X);
        const Vector3d upper = X - at.cast<double>(), lower = Vector3d::Ones() - upper;
        for (int k = 0; k < 8; ++k) {
            const Index3 c = corner_of(k);
            lattice.weight(k, i) = (c[0] ? upper : lower)[0] * (c[1] ? upper : lower)[1] * (c[2] ? upper : lower)[2];
        }
        lattice.cell.push_back(cell_numbers.of(at));
        if (lattice.cell.back() == static_cast<int>(place.size())) place.push_back(at);
    }
    lattice.corner.resize(8, cell_numbers.count());
    for (int c = 0; c < lattice.cell_count(); ++c)
        for (int k = 0; k < 8; ++k) lattice.corner(k, c) = point_numbers.of(place[c] + corner_of(k));
    lattice.point_count = point_numbers.count();

    lattice.offset.assign(lattice.cell_count() + 1, 0);
    for (const int c : lattice.cell) ++lattice.offset[c + 1];
    for (int c = 0; c < lattice.cell_count(); ++c) lattice.offset[c + 1] += lattice.offset[c];
    lattice.node.resize(lattice.cell.size());
    std::vector<int> next(lattice.offset.begin(), lattice.offset.end() - 1);
    for (int i = 0; i < static_cast<int>(lattice.cell.size()); ++i) lattice.node[next[lattice.cell[i]]++] = i;
    return lattice;
}

MatrixXd prolonged(const Lattice& lattice, const MatrixXd& of_points) {
    MatrixXd result = MatrixXd::Zero(3 * static_cast<Eigen::Index>(lattice.cell.size()), of_points.cols());
    parallel_for(0, static_cast<int>(of_points.cols()), [&](int column) {
        for (int i = 0; i < static_cast<int>(lattice.cell.size()); ++i)
            for (int a = 0; a < 8; ++a)
                result.col(column).segment<3>(3 * i) +=
                    lattice.weight(a, i) * of_points.col(column).segment<3>(3 * lattice.corner(a, lattice.cell[i]));
    });
    return result;
}

MatrixXd restricted(const Lattice& lattice, const MatrixXd& of_nodes) {
    MatrixXd result = MatrixXd::Zero(3 * static_cast<Eigen::Index>(lattice.point_count), of_nodes.cols());
    parallel_for(0, static_cast<int>(of_nodes.cols()), [&](int column) {
        for (int i = 0; i < static_cast<int>(lattice.cell.size()); ++i)
            for (int a = 0; a < 8; ++a)
                result.col(column).segment<3>(3 * lattice.corner(a, lattice.cell[i])) +=
                    lattice.weight(a, i) * of_nodes.col(column).segment<3>(3 * i);
    });
    return result;
}

BlockRows galerkin(const Lattice& lattice, const BlockRows& K) {
    std::vector<Share> shares(lattice.cell_count());
    parallel_for(0, lattice.cell_count(), [&](int cell) { shares[cell] = share_of(lattice, K, cell); });
    const auto about = cells_about(lattice);
    std::vector<std::map<int, Matrix3d>> rows(lattice.point_count);
    parallel_for(0, lattice.point_count, [&](int point) {
        for (const auto& [cell, a] : about[point]) {
            const Share& share = shares[cell];
            for (int t = 0; t < static_cast<int>(share.touched.size()); ++t)
                rows[point].try_emplace(share.touched[t], Matrix3d::Zero()).first->second +=
                    share.blocks.block<3, 3>(3 * a, 3 * t);
        }
    });
    BlockRows result;
    result.offset.push_back(0);
    for (const auto& row : rows) {
        for (const auto& [column, block] : row) {
            result.column.push_back(column);
            result.block.push_back(block);
        }
        result.offset.push_back(static_cast<int>(result.column.size()));
    }
    return result;
}

}  // namespace tissuewarp::tled::detail
