#include "meshing/detail/surface_seeds.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace tissuewarp::meshing::detail {

namespace {

constexpr int least_seeds = 6, most_seeds = 24;
constexpr std::size_t most_candidates = 3000;

struct Face {
    std::size_t voxel, neighbour;
};

/// Farthest-point sampling of one piece's surface, the seeds that lie on it already included.
class Sampler {
public:
    Sampler(const LabelGrid& grid, const Components& components) : grid_(grid), components_(components) {}

    void sample(std::int32_t piece, const std::vector<Face>& faces, double edge_length) {
        const std::size_t skip = std::max<std::size_t>(1, faces.size() / most_candidates);
        std::vector<Eigen::Array3d> places;
        std::vector<double> distance;
        for (std::size_t f = 0; f < faces.size(); f += skip) {
            places.push_back(0.5 * (centre(faces[f].voxel) + centre(faces[f].neighbour)));
            distance.push_back(std::numeric_limits<double>::infinity());
            for (const Eigen::Array3d& seed : places_) update(distance.back(), places.back(), seed);
        }
        int count = static_cast<int>(std::count_if(chosen_.begin(), chosen_.end(), [&](const Face& face) {
            return components_.of_voxel[face.voxel] == piece || components_.of_voxel[face.neighbour] == piece;
        }));
        for (; count < most_seeds && !places.empty(); ++count) {
            const auto next =
                static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
            const double spacing = (count < least_seeds ? 0.25 : 0.7) * edge_length;
            if (distance[next] < spacing * spacing) return;
            chosen_.push_back(faces[next * skip]);
            places_.push_back(places[next]);
            for (std::size_t c = 0; c < places.size(); ++c) update(distance[c], places[c], places_.back());
        }
    }

    /// Every face within two voxels of one in the middle of the list.
    void add_cluster(const std::vector<Face>& faces) {
        const auto place = [&](const Face& face) -> Eigen::Array3d {
            return 0.5 * (centre(face.voxel) + centre(face.neighbour));
        };
        const Eigen::Array3d middle = place(faces[faces.size() / 2]);
        for (const Face& face : faces) {
            const Eigen::Array3d here = place(face);
            if (((here - middle) / grid_.spacing).matrix().norm() > 2.0) continue;
            chosen_.push_back(face);
            places_.push_back(here);
        }
    }

    [[nodiscard]] std::vector<SurfaceSeed> seeds() const {
        std::vector<SurfaceSeed> result;
        for (const Face& face : chosen_) result.push_back({centre(face.voxel), centre(face.neighbour)});
        return result;
    }

private:
    static void update(double& squared, const Eigen::Array3d& a, const Eigen::Array3d& b) {
        squared = std::min(squared, (a - b).matrix().squaredNorm());
    }
    [[nodiscard]] Eigen::Array3d centre(std::size_t voxel) const {
        const auto nx = static_cast<std::size_t>(grid_.size[0]), ny = static_cast<std::size_t>(grid_.size[1]);
        return grid_.spacing * Eigen::Array3d(static_cast<double>(voxel % nx), static_cast<double>(voxel / nx % ny),
                                              static_cast<double>(voxel / nx / ny));
    }

    const LabelGrid& grid_;
    const Components& components_;
    std::vector<Face> chosen_;
    std::vector<Eigen::Array3d> places_;
};

/// Faces between voxels of different class, by the piece of their first voxel.
std::vector<std::vector<Face>> faces_of_pieces(const LabelGrid& grid, const std::vector<std::uint16_t>& classes,
                                               const Components& components) {
    std::vector<std::vector<Face>> faces(components.class_of.size());
    for (int k = 1; k + 1 < grid.size[2]; ++k)
        for (int j = 1; j + 1 < grid.size[1]; ++j)
            for (int i = 1; i + 1 < grid.size[0]; ++i) {
                const std::size_t v = grid.offset(i, j, k);
                for (std::size_t step : {std::size_t{1}, grid.offset(0, 1, 0), grid.offset(0, 0, 1)})
                    for (std::size_t neighbour : {v - step, v + step})
                        if (classes[neighbour] != classes[v])
                            faces[static_cast<std::size_t>(components.of_voxel[v])].push_back({v, neighbour});
            }
    return faces;
}

}  // namespace

std::vector<SurfaceSeed> surface_seeds(const LabelGrid& grid, const LabelField& field,
                                       const std::vector<double>& edge_length, const std::vector<char>& thin,
                                       Observer& observer) {
    const Components components = connected_components(grid, field.classes());
    const auto faces = faces_of_pieces(grid, field.classes(), components);
    std::vector<std::int64_t> largest(grid.values.size(), 0);
    for (std::size_t c = 0; c < components.class_of.size(); ++c) {
        auto& most = largest[components.class_of[c]];
        most = std::max(most, components.voxels[c]);
    }
    // Small pieces first: they need their own seeds, the large ones share them.
    std::vector<std::int32_t> order(components.class_of.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
        return components.voxels[static_cast<std::size_t>(a)] < components.voxels[static_cast<std::size_t>(b)];
    });
    Sampler sampler(grid, components);
    for (std::int32_t piece : order) {
        if (observer.cancel_requested()) throw Cancelled();
        const auto c = static_cast<std::size_t>(piece);
        const double edge = edge_length[components.class_of[c]];
        const double volume = static_cast<double>(components.voxels[c]) * grid.spacing.prod();
        // Smoothing may leave crumbs: below half a regular tetrahedron of that edge they are not looked for.
        if (volume < 0.059 * edge * edge * edge && components.voxels[c] < largest[components.class_of[c]]) continue;
        if (thin[components.class_of[c]] && !faces[c].empty()) sampler.add_cluster(faces[c]);
        sampler.sample(piece, faces[c], edge);
    }
    return sampler.seeds();
}

}  // namespace tissuewarp::meshing::detail
