#include "meshing/hex_primitives.hpp"

#include "meshing/primitives.hpp"

namespace tissuewarp::meshing {

MixedMesh box_hexes(const Eigen::Vector3d& size, const std::array<int, 3>& cells, double jitter, std::uint32_t seed) {
    return mixed_box(
        size, cells, [](int, int, int) { return true; }, jitter, seed);
}

MixedMesh mixed_box(const Eigen::Vector3d& size, const std::array<int, 3>& cells,
                    const std::function<bool(int, int, int)>& is_hexahedron, double jitter, std::uint32_t seed) {
    MixedMesh box{box_mesh(size, cells, jitter, seed), {}};
    TetMesh& mesh = box.mesh;
    HexCells& hexahedra = box.hexahedra;
    const auto [nx, ny, nz] = cells;
    const int rows = nx + 1, layers = rows * (ny + 1);
    hexahedra.hexes.resize(8, Eigen::Index{nx} * ny * nz);
    Eigen::Index hex_count = 0, tet_count = 0;
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) {
                const Eigen::Index cell = i + Eigen::Index{nx} * (j + Eigen::Index{ny} * k);
                if (!is_hexahedron(i, j, k)) {
                    mesh.tets.middleCols(tet_count, 6) = mesh.tets.middleCols(6 * cell, 6).eval();
                    tet_count += 6;
                    continue;
                }
                const int low = i + rows * j + layers * k;
                hexahedra.hexes.col(hex_count++) << low, low + 1, low + 1 + rows, low + rows, low + layers,
                    low + 1 + layers, low + 1 + rows + layers, low + rows + layers;
            }
    mesh.tets.conservativeResize(4, tet_count);
    mesh.labels = Eigen::VectorXi::Ones(tet_count);
    hexahedra.hexes.conservativeResize(8, hex_count);
    hexahedra.labels = Eigen::VectorXi::Ones(hex_count);
    if (jitter > 0.0) require_valid(mesh.nodes, hexahedra, "mixed_box");
    return box;
}

}  // namespace tissuewarp::meshing
