#include "registration/matching/gpu/gpu_match_layout.hpp"

#include "registration/field/rasterisation.hpp"
#include "registration/matching/descriptors/grid_samples.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

constexpr std::uint32_t no_owner = 0xffffffff;

/// The lowest element that holds each voxel.
std::vector<std::uint32_t> owners(const meshing::TetMesh& mesh, const imaging::Geometry& grid) {
    std::vector<std::uint32_t> owner(static_cast<std::size_t>(grid.voxel_count()), no_owner);
    const Eigen::Matrix3Xd index = grid.point_to_index() * (mesh.nodes.colwise() - grid.origin);
    rasterise(index, mesh.tets, grid.size, [&](int tet, const Eigen::Vector4d&) {
        return [&, tet](const TetRow& row) {
            const auto start = owner.begin() + grid.size[0] * (row.j + std::ptrdiff_t{grid.size[1]} * row.k);
            std::replace(start + row.first, start + row.last + 1, no_owner, static_cast<std::uint32_t>(tet));
        };
    });
    return owner;
}

/// Voxels of the grid in the mesh that its image shows with their six neighbours.
std::vector<std::uint32_t> counting(const MatchingImage& moving, const MatchLayout& layout) {
    constexpr int rim = GridSamples::rim;
    const auto &size = moving.grid.size, &wide = layout.wide.size;
    const std::array<std::int64_t, 3> stride{1, size[0], std::int64_t{size[0]} * size[1]};
    std::vector<std::uint32_t> counts(moving.seen.size());
    for (int k = 1; k < size[2] - 1; ++k)
        for (int j = 1; j < size[1] - 1; ++j)
            for (int i = 1; i < size[0] - 1; ++i) {
                const std::int64_t in_wide = i + rim + wide[0] * (j + rim + std::int64_t{wide[1]} * (k + rim));
                if (layout.owner[static_cast<std::size_t>(in_wide)] == no_owner) continue;
                const std::int64_t n = moving.offset({i, j, k});
                const auto shown = [&](std::int64_t at) { return moving.seen[static_cast<std::size_t>(at)] != 0; };
                counts[static_cast<std::size_t>(n)] =
                    shown(n) && std::all_of(stride.begin(), stride.end(),
                                            [&](std::int64_t s) { return shown(n - s) && shown(n + s); });
            }
    return counts;
}

}  // namespace

MatchGridBlock match_grid_block(const imaging::Geometry& wide, const imaging::Geometry& fixed,
                                const std::array<int, 3>& cells, const Eigen::Isometry3d& placement) {
    const Eigen::Matrix3d shift = fixed.point_to_index() * placement.linear(), matrix = shift * wide.index_to_point();
    const Eigen::Vector3d start = fixed.index(placement * wide.origin);
    MatchGridBlock block{packed(wide.size), packed(fixed.size), packed(cells), {}, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto row = static_cast<Eigen::Index>(axis);
        block.to_fixed_index[axis] = packed(matrix.row(row).transpose(), start[row]);
        block.shift_to_index[axis] = packed(shift.row(row).transpose());
    }
    return block;
}

std::vector<MatchElement> elements_of(const meshing::TetMesh& mesh, const imaging::Geometry& wide) {
    const Eigen::Matrix3Xd index = wide.point_to_index() * (mesh.nodes.colwise() - wide.origin);
    std::vector<MatchElement> elements;
    for (const auto& tet : mesh.tets.colwise()) {
        MatchElement element{{static_cast<std::uint32_t>(tet[0]), static_cast<std::uint32_t>(tet[1]),
                              static_cast<std::uint32_t>(tet[2]), static_cast<std::uint32_t>(tet[3])},
                             {},
                             {}};
        BarycentricMap map;
        if (map.set(index(Eigen::all, tet)) != 0) {  // a flat one holds no voxel
            element.corner = packed(map.corner);
            for (std::size_t n = 0; n < 3; ++n)
                element.gradient[n] = packed(map.matrix.row(static_cast<Eigen::Index>(n) + 1).transpose());
        }
        elements.push_back(element);
    }
    return elements;
}

std::optional<DenseForce> force_of(const MatchForce& cell, const Voxel& first, const imaging::Geometry& grid) {
    if (cell.said == 0) return std::nullopt;
    const Eigen::Vector3d begin(first[0], first[1], first[2]), places(cell.places[0], cell.places[1], cell.places[2]);
    const Eigen::Vector3d shift = Eigen::Vector3f(cell.shift.data()).cast<double>();
    const Eigen::Matrix3d root = grid.direction * Eigen::Matrix3f(cell.root.data()).cast<double>();
    const double h = grid.spacing[0];
    return DenseForce{grid.point(begin + places / cell.voxels), h * grid.direction * shift,
                      root * root.transpose() / (h * h)};
}

MatchLayout match_layout(const meshing::TetMesh& mesh, const MatchingImage& moving) {
    MatchLayout layout;
    layout.wide = GridSamples::with_rim(moving.grid);
    layout.owner = owners(mesh, layout.wide);
    layout.counts = counting(moving, layout);
    std::vector<std::uint8_t> inside(layout.owner.size());
    std::transform(layout.owner.begin(), layout.owner.end(), inside.begin(), [](auto e) { return e != no_owner; });
    for (const auto& layer : growth_layers(std::move(inside), layout.wide.size, descriptor_extent)) {
        layout.layers.push_back(
            {static_cast<std::uint32_t>(layout.growth.size()), static_cast<std::uint32_t>(layer.size())});
        layout.growth.insert(layout.growth.end(), layer.begin(), layer.end());
    }
    return layout;
}

std::span<const std::byte> words_of(const MatchingImage& image) {
    static_assert(descriptor_channels == 12, "three words of four channels");
    return std::as_bytes(std::span(image.descriptors.get(), descriptor_channels * image.seen.size()));
}

}  // namespace tissuewarp::registration::detail
