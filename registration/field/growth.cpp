#include "registration/field/growth.hpp"

#include <tbb/parallel_for.h>

#include <utility>

namespace tissuewarp::registration::detail {

namespace {

constexpr std::uint8_t outside = 0, grown = 1, waits = 2;

using Front = std::vector<std::int64_t>;

/// The state of each voxel, and the layer to come by slices, each of which is written to by one thread.
class Growth {
public:
    Growth(std::vector<std::uint8_t> inside, const std::array<int, 3>& size)
        : state_(std::move(inside)),
          size_(size),
          row_(size[0]),
          slice_(row_ * size[1]),
          fronts_(static_cast<std::size_t>(size[2])),
          next_(fronts_.size()) {
        for_each_slice([&](std::size_t k) { fronts_[k] = beside_grown(static_cast<int>(k)); });
    }

    /// The layer to come, which has grown then.
    std::vector<GrownVoxel> layer() {
        std::vector<std::vector<GrownVoxel>> entries(fronts_.size());
        for_each_slice([&](std::size_t k) {
            for (const std::int64_t voxel : fronts_[k]) {
                GrownVoxel entry{static_cast<std::uint32_t>(voxel), 0};
                for_each_neighbour(voxel, k, [&](std::int64_t other, std::uint32_t bit) {
                    if (state(other) == grown) entry.neighbours |= bit;
                });
                entries[k].push_back(entry);
            }
        });
        for_each_slice([&](std::size_t k) {
            for (const std::int64_t voxel : fronts_[k]) state(voxel) = grown;
        });
        for_each_slice([&](std::size_t k) { find_next(k); });
        fronts_.swap(next_);
        std::vector<GrownVoxel> result;
        for (const auto& of_slice : entries) result.insert(result.end(), of_slice.begin(), of_slice.end());
        return result;
    }

private:
    std::vector<std::uint8_t> state_;
    std::array<int, 3> size_;
    std::int64_t row_, slice_;  // strides
    std::vector<Front> fronts_, next_;

    [[nodiscard]] std::uint8_t& state(std::int64_t voxel) { return state_[static_cast<std::size_t>(voxel)]; }

    template <class Visit>
    void for_each_slice(const Visit& visit) const {
        tbb::parallel_for(std::size_t{0}, fronts_.size(), visit);
    }

    /// Calls visit(neighbour, its bit) for those of a voxel of slice k that lie on the grid.
    template <class Visit>
    void for_each_neighbour(std::int64_t voxel, std::size_t k, const Visit& visit) const {
        const auto in_slice = static_cast<std::uint32_t>(voxel - slice_ * static_cast<std::int64_t>(k)),
                   width = static_cast<std::uint32_t>(row_);
        const int i = static_cast<int>(in_slice % width), j = static_cast<int>(in_slice / width);
        if (i > 0) visit(voxel - 1, 1U);
        if (i + 1 < size_[0]) visit(voxel + 1, 2U);
        if (j > 0) visit(voxel - row_, 4U);
        if (j + 1 < size_[1]) visit(voxel + row_, 8U);
        if (k > 0) visit(voxel - slice_, 16U);
        if (k + 1 < fronts_.size()) visit(voxel + slice_, 32U);
    }

    /// Voxels of a slice that lie outside and beside one that has grown.
    [[nodiscard]] Front beside_grown(int k) const {
        Front result;
        for (int j = 0; j < size_[1]; ++j) {
            const std::uint8_t* here = state_.data() + row_ * j + slice_ * k;
            const std::uint8_t *below = j > 0 ? here - row_ : here, *above = j + 1 < size_[1] ? here + row_ : here,
                               *before = k > 0 ? here - slice_ : here, *after = k + 1 < size_[2] ? here + slice_ : here;
            for (std::int64_t i = 0; i < row_; ++i) {
                if (here[i]) continue;
                const bool along = (i > 0 && here[i - 1]) || (i + 1 < row_ && here[i + 1]);
                if (along || below[i] || above[i] || before[i] || after[i]) result.push_back(here + i - state_.data());
            }
        }
        return result;
    }

    /// Voxels of slice k beside the fronts of it and its two neighbours.
    void find_next(std::size_t k) {
        const std::int64_t first = slice_ * static_cast<std::int64_t>(k);
        next_[k].clear();
        const auto take = [&](std::int64_t voxel) {
            if (voxel < first || voxel >= first + slice_ || state(voxel) != outside) return;
            state(voxel) = waits;
            next_[k].push_back(voxel);
        };
        for (const std::int64_t voxel : fronts_[k])
            for_each_neighbour(voxel, k, [&](std::int64_t other, std::uint32_t) { take(other); });
        if (k > 0)
            for (const std::int64_t voxel : fronts_[k - 1]) take(voxel + slice_);
        if (k + 1 < fronts_.size())
            for (const std::int64_t voxel : fronts_[k + 1]) take(voxel - slice_);
    }
};

}  // namespace

std::vector<std::vector<GrownVoxel>> growth_layers(std::vector<std::uint8_t> inside, const std::array<int, 3>& size,
                                                   int count) {
    Growth growth(std::move(inside), size);
    std::vector<std::vector<GrownVoxel>> layers(static_cast<std::size_t>(count));
    for (std::vector<GrownVoxel>& layer : layers) layer = growth.layer();
    return layers;
}

}  // namespace tissuewarp::registration::detail
