#include "tled/gpu/patch_layout.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <string>

namespace tissuewarp::tled::detail {
namespace {

constexpr std::uint32_t no_local_node = 0xffffU;
constexpr std::uint32_t other_material = 0x80000000U;  // flag of a source

/// A node's place in a patch.
struct Slot {
    int patch, local;
};

std::size_t index(int value) {
    return static_cast<std::size_t>(value);
}
std::uint32_t word(std::size_t value) {
    return static_cast<std::uint32_t>(value);
}

/// The slots of every node, ascending by patch: the order in which all of them sum its forces.
std::vector<std::vector<Slot>> slots_of_nodes(int node_count, const std::vector<Patch>& patches) {
    std::vector<std::vector<Slot>> slots(index(node_count));
    for (std::size_t p = 0; p < patches.size(); ++p)
        for (std::size_t i = 0; i < patches[p].node.size(); ++i)
            slots[index(patches[p].node[i])].push_back({static_cast<int>(p), static_cast<int>(i)});
    return slots;
}

std::size_t shared_count(const Patch& patch, const std::vector<std::vector<Slot>>& slots) {
    const auto first_own =
        std::find_if(patch.node.begin(), patch.node.end(), [&](int a) { return slots[index(a)].size() < 2; });
    return static_cast<std::size_t>(first_own - patch.node.begin());
}

/// Number of slots in each plane of a patch's sources: plane j holds the nodes of more than j patches and at least
/// three, which are the first ones because most shared nodes come first.
std::vector<std::size_t> source_planes(const Patch& patch, const std::vector<std::vector<Slot>>& slots) {
    std::vector<std::size_t> planes;
    for (const int a : patch.node) {
        const std::size_t shares = slots[index(a)].size();
        if (shares < 3) break;
        if (planes.size() < shares) planes.resize(shares);
        for (std::size_t j = 0; j < shares; ++j) ++planes[j];
    }
    return planes;
}

/// Other patches that share a node with patch p, ascending.
std::vector<std::uint32_t> neighbours_of(std::size_t p, const Patch& patch,
                                         const std::vector<std::vector<Slot>>& slots) {
    std::vector<std::uint32_t> result;
    for (const int a : patch.node)
        for (const Slot& slot : slots[index(a)])
            if (index(slot.patch) != p) result.push_back(word(index(slot.patch)));
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
}

/// Most nodes of fans that are one node of the patch.
std::size_t most_contributions(const Patch& patch) {
    std::vector<std::size_t> count(patch.node.size());
    for (const Fan& fan : patch.fan) {
        ++count[index(fan.a)];
        ++count[index(fan.b)];
        for (std::size_t k = 0; k <= index(fan.length); ++k) ++count[index(fan.ring[k])];
    }
    return count.empty() ? 0 : *std::max_element(count.begin(), count.end());
}

Uint4 packed(const Fan& fan) {
    std::array<std::uint32_t, most_of_a_fan + 3> local;
    local.fill(no_local_node);
    local[0] = word(index(fan.a));
    local[1] = word(index(fan.b));
    for (std::size_t k = 0; k <= index(fan.length); ++k) local[2 + k] = word(index(fan.ring[k]));
    Uint4 result{};
    for (std::size_t k = 0; k < 4; ++k) result[k] = local[2 * k] | local[2 * k + 1] << 16U;
    return result;
}

std::size_t sum(const std::vector<std::size_t>& counts) {
    return std::accumulate(counts.begin(), counts.end(), std::size_t{0});
}

PatchCapacity capacity_of(const std::vector<Patch>& patches, const std::vector<std::vector<Slot>>& slots,
                          const std::vector<std::vector<std::size_t>>& planes) {
    PatchCapacity c;
    c.patches = static_cast<int>(patches.size());
    const auto grow = [](int& value, std::size_t to) { value = std::max(value, static_cast<int>(to)); };
    for (std::size_t p = 0; p < patches.size(); ++p) {
        grow(c.slots, slots_for(patches[p].node.size()));
        grow(c.fans, patches[p].fan.size());
        for (const Fan& fan : patches[p].fan) grow(c.longest_fan, index(fan.length));
        const std::size_t in_planes = planes[p].empty() ? 0 : planes[p].front();
        grow(c.sources, sum(planes[p]) + shared_count(patches[p], slots) - in_planes);
        grow(c.contributions, most_contributions(patches[p]));
    }
    if (c.fans >= static_cast<int>(no_local_node) || c.slots >= static_cast<int>(no_local_node))
        throw InvalidInput("a patch has " + std::to_string(c.slots) + " nodes and " + std::to_string(c.fans) +
                           " fans; 16 bits count to 65534: take smaller patches");
    const double total = 8.0 * c.patches * std::max(c.sources, c.slots);
    if (total > std::numeric_limits<std::int32_t>::max())
        throw InvalidInput("the patches hold " + std::to_string(total) + " numbers; 31 bits count to 2147483647");
    return c;
}

class LayoutBuilder {
public:
    LayoutBuilder(const RestState& rest, const std::vector<Patch>& patches)
        : rest_(rest), patches_(patches), slots_(slots_of_nodes(rest.node_count, patches)) {
        for (std::size_t p = 0; p < patches.size(); ++p) {
            planes_.push_back(source_planes(patches[p], slots_));
            neighbours_.push_back(neighbours_of(p, patches[p], slots_));
            if (planes_.back().size() > most_sharing_patches)
                throw InvalidInput(std::to_string(planes_.back().size()) + " patches share a node; at most " +
                                   std::to_string(most_sharing_patches) + " can: take larger patches");
        }
        layout_.capacity = capacity_of(patches, slots_, planes_);
        PatchCapacity& c = layout_.capacity;
        for (const auto& each : neighbours_) c.neighbours = std::max(c.neighbours, static_cast<int>(each.size()));
        const auto room = [&](int each) { return index(c.patches) * index(each); };
        layout_.head.resize(room(3));
        layout_.fans.resize(room(c.fans));
        layout_.rest.resize(8 * room(c.slots));
        layout_.sources.resize(room(c.sources));
        layout_.neighbours.resize(room(c.neighbours));
        layout_.node_of_slot.resize(room(c.slots), no_slot);
        layout_.slot_of_node.resize(index(rest.node_count), no_slot);
    }

    PatchLayout build() {
        for (std::size_t p = 0; p < patches_.size(); ++p) {
            write_head(p);
            write_nodes(p);
            write_inverse_volumes(p);
            write_fans(p);
            write_sources(p);
        }
        if (rest_.fibre.cols() > 0 || !rest_.viscosity.empty()) write_places();
        return std::move(layout_);
    }

private:
    const RestState& rest_;
    const std::vector<Patch>& patches_;
    std::vector<std::vector<Slot>> slots_;
    std::vector<std::vector<std::size_t>> planes_;  ///< of each patch's sources
    std::vector<std::vector<std::uint32_t>> neighbours_;
    PatchLayout layout_;

    void write_head(std::size_t p) {
        const Patch& patch = patches_[p];
        const double modulus = volumetric_modulus(rest_.materials[index(patch.material)]);
        layout_.head[3 * p] = {word(patch.node.size() | patch.fan.size() << 16U),
                               word(index(patch.material) | sum(planes_[p]) << 16U),
                               std::bit_cast<std::uint32_t>(static_cast<float>(modulus)),
                               word(neighbours_[p].size() | shared_count(patch, slots_) << 16U)};
        for (std::size_t j = 0; j < planes_[p].size(); ++j)
            layout_.head[3 * p + 1 + j / 8][j % 8 / 2] |= word(planes_[p][j] << 16 * (j % 2));
        std::copy(neighbours_[p].begin(), neighbours_[p].end(),
                  layout_.neighbours.begin() + static_cast<std::ptrdiff_t>(p * index(layout_.capacity.neighbours)));
    }

    /// Positions from the mean of the patch: single precision keeps the digits of edges far from the origin.
    void write_nodes(std::size_t p) {
        const std::vector<int>& nodes = patches_[p].node;
        const Eigen::Vector3d origin = rest_.position(Eigen::all, nodes).rowwise().mean();
        const std::size_t first = p * index(layout_.capacity.slots), plane = layout_.node_of_slot.size();
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            const Eigen::Vector3f X = (rest_.position.col(nodes[i]) - origin).cast<float>();
            for (std::size_t c = 0; c < 3; ++c) layout_.rest[c * plane + first + i] = X[static_cast<Eigen::Index>(c)];
            layout_.node_of_slot[first + i] = word(index(nodes[i]));
            std::uint32_t& owner = layout_.slot_of_node[index(nodes[i])];
            if (owner == no_slot) owner = word(first + i);
        }
    }

    /// 1 / V_a of the averaged pressure, of this patch's material.
    void write_inverse_volumes(std::size_t p) {
        if (rest_.pressure.count() == 0) return;
        const std::size_t first = 7 * layout_.node_of_slot.size() + p * index(layout_.capacity.slots);
        for (const int e : patches_[p].tet)
            for (int k = 0; k < 4; ++k) {
                const std::vector<Slot>& shared = slots_[index(rest_.nodes(k, e))];
                const auto own = std::find_if(shared.begin(), shared.end(),
                                              [&](const Slot& slot) { return index(slot.patch) == p; });
                layout_.rest[first + index(own->local)] =
                    static_cast<float>(1 / rest_.pressure.volume[rest_.pressure.of_element(k, e)]);
            }
    }

    void write_fans(std::size_t p) {
        const std::vector<Fan>& fans = patches_[p].fan;
        std::transform(fans.begin(), fans.end(),
                       layout_.fans.begin() + static_cast<std::ptrdiff_t>(p * index(layout_.capacity.fans)), packed);
    }

    void write_places() {
        const std::size_t patches = index(layout_.capacity.patches), fans = index(layout_.capacity.fans);
        layout_.element_of_place.assign(index(layout_.capacity.longest_fan) * patches * fans, no_slot);
        for (std::size_t p = 0; p < patches; ++p)
            for (std::size_t f = 0; f < patches_[p].fan.size(); ++f) {
                const Fan& fan = patches_[p].fan[f];
                for (std::size_t k = 0; k < index(fan.length); ++k)
                    layout_.element_of_place[(k * patches + p) * fans + f] =
                        word(index(patches_[p].tet[index(fan.tet[k])]));
            }
    }

    void write_sources(std::size_t p) {
        std::size_t begin = p * index(layout_.capacity.sources);
        for (std::size_t j = 0; j < planes_[p].size(); ++j) {
            for (std::size_t i = 0; i < planes_[p][j]; ++i) {
                layout_.sources[begin + i] = source_for(p, slots_[index(patches_[p].node[i])][j]);
            }
            begin += planes_[p][j];
        }
        const std::size_t first_pair = planes_[p].empty() ? 0 : planes_[p].front();
        for (std::size_t i = first_pair; i < shared_count(patches_[p], slots_); ++i) {
            const std::vector<Slot>& pair = slots_[index(patches_[p].node[i])];
            layout_.sources[begin++] = source_for(p, index(pair[0].patch) == p ? pair[1] : pair[0]);
        }
    }

    [[nodiscard]] std::uint32_t source_for(std::size_t p, const Slot& slot) const {
        const std::uint32_t number = word(index(slot.patch) * index(layout_.capacity.slots) + index(slot.local));
        const bool same_material = patches_[index(slot.patch)].material == patches_[p].material;
        return same_material ? number : number | other_material;
    }
};

}  // namespace

std::size_t most_sharing(int node_count, const std::vector<Patch>& patches) {
    std::vector<std::size_t> count(index(node_count));
    for (const Patch& patch : patches)
        for (const int a : patch.node) ++count[index(a)];
    return count.empty() ? 0 : *std::max_element(count.begin(), count.end());
}

PatchLayout patch_layout(const RestState& rest, const std::vector<Patch>& patches) {
    return LayoutBuilder(rest, patches).build();
}

}  // namespace tissuewarp::tled::detail
