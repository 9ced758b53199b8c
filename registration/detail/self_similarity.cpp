#include "imaging/filters.hpp"
#include "registration/detail/matching_image.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

constexpr int dilation = 2;        // voxels from the centre to the six neighbours
constexpr double patch_sigma = 1;  // voxels, of the Gaussian window of a patch

Voxel clamped(const Voxel& voxel, const Voxel& size) {
    Voxel result;
    for (std::size_t a = 0; a < 3; ++a) result[a] = std::clamp(voxel[a], 0, size[a] - 1);
    return result;
}

template <class Visit>
void for_each_voxel(const imaging::Geometry& grid, const Visit& visit) {
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) visit(Voxel{i, j, k});
    });
}

/// Patch distance between a voxel and the one `step` further.
Volume patch_distance(const Volume& image, const Voxel& step) {
    Volume squared(image.geometry, CV_32FC1);
    const float* value = image.data<float>();
    float* result = squared.data<float>();
    for_each_voxel(image.geometry, [&](const Voxel& v) {
        const Voxel w = clamped({v[0] + step[0], v[1] + step[1], v[2] + step[2]}, image.geometry.size);
        const float difference = value[image.offset(w[0], w[1], w[2])] - value[image.offset(v[0], v[1], v[2])];
        result[image.offset(v[0], v[1], v[2])] = difference * difference;
    });
    return imaging::smooth(squared, patch_sigma * image.geometry.spacing[0]);
}

/// Where a channel's patch distance is kept: in distances[pair], at a voxel `shift` away.
struct Channel {
    std::size_t pair;
    Voxel shift;
};

struct Pattern {
    std::array<Voxel, 6> steps;  ///< between the two patches of a pair
    std::array<Channel, descriptor_channels> channels;
};

/// The edges of the octahedron of the six neighbours. Opposite edges share a step, so six maps hold all twelve.
Pattern octahedron_edges() {
    Pattern pattern{};
    std::size_t pair = 0, channel = 0;
    for (std::size_t p = 0; p < 3; ++p)
        for (std::size_t q = p + 1; q < 3; ++q)
            for (const int sign : {-1, 1}) {
                Voxel step{}, at_q{}, at_p{};
                step[p] = dilation;
                step[q] = sign * dilation;
                at_q[q] = -sign * dilation;  // + step: the neighbour at +p
                at_p[p] = -dilation;         // + step: the neighbour at sign · q
                pattern.steps[pair] = step;
                pattern.channels[channel++] = {pair, at_q};
                pattern.channels[channel++] = {pair, at_p};
                ++pair;
            }
    return pattern;
}

using Distances = std::array<float, descriptor_channels>;

class DistanceReader {
public:
    explicit DistanceReader(const Volume& image) : geometry_(image.geometry), pattern_(octahedron_edges()) {
        for (std::size_t n = 0; n < maps_.size(); ++n) maps_[n] = patch_distance(image, pattern_.steps[n]);
    }
    [[nodiscard]] Distances at(const Voxel& v) const {
        Distances result;
        for (std::size_t c = 0; c < result.size(); ++c) {
            const auto& [pair, shift] = pattern_.channels[c];
            const Voxel w = clamped({v[0] + shift[0], v[1] + shift[1], v[2] + shift[2]}, geometry_.size);
            result[c] = maps_[pair].data<float>()[maps_[pair].offset(w[0], w[1], w[2])];
        }
        return result;
    }

private:
    imaging::Geometry geometry_;
    Pattern pattern_;
    std::array<Volume, 6> maps_;
};

float mean_of(const Distances& distances) {
    float sum = 0;
    for (const float d : distances) sum += d;
    return sum / descriptor_channels;
}

/// Mean over the seen voxels, summed slice by slice in order: the same for any number of threads.
double mean_where_seen(const std::vector<float>& values, const Volume& seen) {
    double sum = 0;
    std::int64_t count = 0;
    for (std::size_t n = 0; n < values.size(); ++n) {
        if (!seen.data<std::uint8_t>()[n]) continue;
        sum += double(values[n]);
        ++count;
    }
    return count > 0 ? sum / double(count) : 0.0;
}

}  // namespace

std::vector<std::uint8_t> self_similarity_context(const Volume& image, const Volume& seen) {
    const DistanceReader distances(image);
    std::vector<float> variance(static_cast<std::size_t>(image.geometry.voxel_count()));
    for_each_voxel(image.geometry, [&](const Voxel& v) {
        variance[static_cast<std::size_t>(image.offset(v[0], v[1], v[2]))] = mean_of(distances.at(v));
    });
    const double mean = std::max(mean_where_seen(variance, seen), 1e-30);
    const auto least = static_cast<float>(1e-3 * mean), most = static_cast<float>(1e3 * mean);

    std::vector<std::uint8_t> result(variance.size() * descriptor_channels);
    for_each_voxel(image.geometry, [&](const Voxel& v) {
        const auto n = static_cast<std::size_t>(image.offset(v[0], v[1], v[2]));
        const Distances d = distances.at(v);
        const float smallest = *std::min_element(d.begin(), d.end());
        const float scale = 1 / std::clamp(variance[n], least, most);
        for (std::size_t c = 0; c < d.size(); ++c)
            result[n * descriptor_channels + c] =
                static_cast<std::uint8_t>(std::lround(255 * std::exp((smallest - d[c]) * scale)));
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
