#include "meshing/primitives.hpp"

#include "core/errors.hpp"

#include <Eigen/Dense>

#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace tissuewarp::meshing {

namespace {

/// Kuhn's six tetrahedra: paths from corner 000 to corner 111 of the cell, one axis at a time. Corner c has bit 0 for
/// i, bit 1 for j, bit 2 for k. Every cell uses the same diagonal, so that neighbours agree on their common face.
constexpr int kuhn_tets[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

void require_box(const Eigen::Vector3d& size, const std::array<int, 3>& cells) {
    for (int axis = 0; axis < 3; ++axis) {
        if (!(size[axis] > 0.0) || !std::isfinite(size[axis]))
            throw InvalidInput("box_mesh: size " + std::to_string(size[axis]) + " mm along axis " +
                               std::to_string(axis) + "; it must be positive and finite");
        if (cells[axis] < 1)
            throw InvalidInput("box_mesh: " + std::to_string(cells[axis]) + " cells along axis " +
                               std::to_string(axis) + "; at least 1 is needed");
    }
    if (8.0 * cells[0] * cells[1] * cells[2] > 2e9)
        throw InvalidInput("box_mesh: more than 2.5e8 cells do not fit 32-bit indices; use fewer cells");
}

void require_ascending(const std::array<std::vector<double>, 3>& coordinates) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::vector<double>& list = coordinates[axis];
        if (list.size() < 2)
            throw InvalidInput("box_mesh: " + std::to_string(list.size()) + " coordinates along axis " +
                               std::to_string(axis) + "; at least 2 are needed");
        for (std::size_t i = 0; i + 1 < list.size(); ++i) {
            if (list[i] < list[i + 1] && std::isfinite(list[i + 1] - list[i])) continue;
            throw InvalidInput("box_mesh: coordinate " + std::to_string(list[i + 1]) + " mm along axis " +
                               std::to_string(axis) + " does not follow " + std::to_string(list[i]) +
                               " mm; the lists must ascend");
        }
    }
}

/// Uniform in [−1, 1); std::uniform_real_distribution differs between standard libraries, the engine does not.
double symmetric_uniform(std::mt19937& engine) {
    return engine() / 2147483648.0 - 1.0;
}

}  // namespace

TetMesh box_mesh(const Eigen::Vector3d& size, const std::array<int, 3>& cells, double jitter, std::uint32_t seed) {
    require_box(size, cells);
    const auto [nx, ny, nz] = cells;
    const auto node = [nx = nx, ny = ny](int i, int j, int k) { return i + (nx + 1) * (j + (ny + 1) * k); };
    const Eigen::Array3d edge = size.array() / Eigen::Array3d(nx, ny, nz);
    TetMesh mesh;
    mesh.nodes.resize(3, Eigen::Index{nx + 1} * (ny + 1) * (nz + 1));
    std::mt19937 engine(seed);
    for (int k = 0; k <= nz; ++k) {
        for (int j = 0; j <= ny; ++j) {
            for (int i = 0; i <= nx; ++i) {
                Eigen::Array3d position = edge * Eigen::Array3d(i, j, k);
                const bool interior = i > 0 && i < nx && j > 0 && j < ny && k > 0 && k < nz;
                if (interior && jitter > 0.0)
                    for (int axis = 0; axis < 3; ++axis)
                        position[axis] += jitter * edge[axis] * symmetric_uniform(engine);
                mesh.nodes.col(node(i, j, k)) = position;
            }
        }
    }
    const Eigen::Index tet_count = Eigen::Index{6} * nx * ny * nz;
    mesh.tets.resize(4, tet_count);
    mesh.labels = Eigen::VectorXi::Ones(tet_count);
    Eigen::Index next = 0;
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i)
                for (const auto& tet : kuhn_tets) {
                    for (int c = 0; c < 4; ++c)
                        mesh.tets(c, next) = node(i + (tet[c] & 1), j + ((tet[c] >> 1) & 1), k + (tet[c] >> 2));
                    ++next;
                }
    if (jitter > 0.0) require_valid(mesh, "box_mesh");
    return mesh;
}

TetMesh box_mesh(const std::array<std::vector<double>, 3>& coordinates) {
    require_ascending(coordinates);
    std::array<int, 3> cells;
    for (std::size_t axis = 0; axis < 3; ++axis) cells[axis] = static_cast<int>(coordinates[axis].size()) - 1;
    TetMesh mesh = box_mesh(Eigen::Vector3d::Ones(), cells);
    Eigen::Index node = 0;
    for (const double z : coordinates[2])
        for (const double y : coordinates[1])
            for (const double x : coordinates[0]) mesh.nodes.col(node++) << x, y, z;
    return mesh;
}

}  // namespace tissuewarp::meshing
