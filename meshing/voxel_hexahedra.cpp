#include "meshing/voxel_hexahedra.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <map>
#include <string>

namespace tissuewarp::meshing {

namespace {

/// Blocks of voxels along each axis, and the lattice of their corners.
struct Blocks {
    std::array<int, 3> count;
    int coarsening;

    Blocks(const imaging::Geometry& geometry, int voxels) : count{}, coarsening(voxels) {
        for (std::size_t axis = 0; axis < 3; ++axis) count[axis] = (geometry.size[axis] + voxels - 1) / voxels;
    }
    [[nodiscard]] std::int64_t corner(int i, int j, int k) const {
        return i + std::int64_t{count[0] + 1} * (j + std::int64_t{count[1] + 1} * k);
    }
    [[nodiscard]] std::int64_t corner_count() const { return corner(count[0], count[1], count[2]) + 1; }
};

/// The most frequent label of a block, 0 for background; `wanted` holds the labels asked for.
int majority(const imaging::Volume& labels, const Blocks& blocks, const std::vector<int>& wanted, int i, int j, int k) {
    const int n = blocks.coarsening;
    const auto& size = labels.geometry.size;
    std::map<int, int> voxels{{0, n * n * n}};
    for (int z = n * k; z < std::min(n * (k + 1), size[2]); ++z)
        for (int y = n * j; y < std::min(n * (j + 1), size[1]); ++y)
            for (int x = n * i; x < std::min(n * (i + 1), size[0]); ++x) {
                const int label = labels.data<std::int32_t>()[labels.offset(x, y, z)];
                if (!std::binary_search(wanted.begin(), wanted.end(), label)) continue;
                ++voxels[label];
                --voxels[0];
            }
    const auto less = [](const auto& a, const auto& b) { return a.second < b.second; };
    return std::max_element(voxels.rbegin(), voxels.rend(), less)->first;  // backward: the largest of equals
}

/// VTK's order for axes of either handedness, as steps along the axes.
std::array<std::array<int, 3>, 8> corner_steps(const imaging::Geometry& geometry) {
    std::array<std::array<int, 3>, 8> steps{
        {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
    if (geometry.direction.determinant() < 0)
        for (const std::size_t corner : {0U, 1U, 2U, 3U}) std::swap(steps[corner], steps[corner + 4]);
    return steps;
}

/// Numbers the corners in use in the order of the lattice and places them.
void place_nodes(const imaging::Geometry& geometry, const Blocks& blocks,
                 const std::vector<std::array<std::int64_t, 8>>& hexes, MixedMesh& result) {
    std::vector<int> node(static_cast<std::size_t>(blocks.corner_count()), -1);
    for (const auto& hex : hexes)
        for (const std::int64_t corner : hex) node[static_cast<std::size_t>(corner)] = 0;
    int count = 0;
    for (int& number : node)
        if (number == 0) number = count++;
    result.mesh.nodes.resize(3, count);
    for (int k = 0; k <= blocks.count[2]; ++k)
        for (int j = 0; j <= blocks.count[1]; ++j)
            for (int i = 0; i <= blocks.count[0]; ++i) {
                const int number = node[static_cast<std::size_t>(blocks.corner(i, j, k))];
                if (number < 0) continue;
                const Eigen::Vector3d index = blocks.coarsening * Eigen::Vector3d(i, j, k).array() - 0.5;
                result.mesh.nodes.col(number) = geometry.point(index);
            }
    result.hexahedra.hexes.resize(8, static_cast<Eigen::Index>(hexes.size()));
    for (std::size_t h = 0; h < hexes.size(); ++h)
        for (std::size_t corner = 0; corner < 8; ++corner)
            result.hexahedra.hexes(static_cast<Eigen::Index>(corner), static_cast<Eigen::Index>(h)) =
                node[static_cast<std::size_t>(hexes[h][corner])];
}

}  // namespace

MixedMesh voxel_hexahedra(const imaging::Volume& labels, const VoxelHexahedraOptions& options) {
    if (options.coarsening < 1)
        throw InvalidInput("voxel_hexahedra: coarsening is " + std::to_string(options.coarsening) +
                           "; give at least 1 voxel");
    if (labels.voxels.type() != CV_32SC1)
        throw InvalidInput("voxel_hexahedra: the labels are not int32; convert them with Volume::as(CV_32S)");
    imaging::require_labels(labels, options.labels, "label volume");
    std::vector<int> wanted = options.labels.empty() ? imaging::labels_in(labels) : options.labels;
    std::sort(wanted.begin(), wanted.end());

    const Blocks blocks(labels.geometry, options.coarsening);
    const auto steps = corner_steps(labels.geometry);
    std::vector<std::array<std::int64_t, 8>> hexes;
    std::vector<int> label_of;
    for (int k = 0; k < blocks.count[2]; ++k)
        for (int j = 0; j < blocks.count[1]; ++j)
            for (int i = 0; i < blocks.count[0]; ++i) {
                const int label = majority(labels, blocks, wanted, i, j, k);
                if (label == 0) continue;
                label_of.push_back(label);
                std::array<std::int64_t, 8> corners{};
                for (std::size_t c = 0; c < 8; ++c)
                    corners[c] = blocks.corner(i + steps[c][0], j + steps[c][1], k + steps[c][2]);
                hexes.push_back(corners);
            }
    if (hexes.empty())
        throw InvalidInput("voxel_hexahedra: no block of " + std::to_string(options.coarsening) +
                           "³ voxels is mostly tissue; lower the coarsening");
    MixedMesh result;
    place_nodes(labels.geometry, blocks, hexes, result);
    result.hexahedra.labels =
        Eigen::Map<const Eigen::VectorXi>(label_of.data(), static_cast<Eigen::Index>(label_of.size()));
    return result;
}

}  // namespace tissuewarp::meshing
