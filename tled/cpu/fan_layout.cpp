#include "tled/cpu/fan_layout.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <string>

namespace tissuewarp::tled::detail {
namespace {

constexpr std::size_t width = batch_width;

std::size_t index(int value) {
    return static_cast<std::size_t>(value);
}
std::uint32_t word(std::size_t value) {
    return static_cast<std::uint32_t>(value);
}

/// Fans by length, each length filling whole groups: what is left over gives its last tetrahedron away as a fan of its
/// own and is one shorter, so that a patch has no more than one group with padding.
std::vector<Fan> filling_groups(const std::vector<Fan>& fans) {
    std::array<std::vector<Fan>, most_of_a_fan + 1> of_length;
    for (const Fan& fan : fans) of_length[index(fan.length)].push_back(fan);
    std::vector<Fan> result;
    for (std::size_t length = most_of_a_fan; length >= 1; --length) {
        std::vector<Fan>& full = of_length[length];
        const std::size_t kept = length == 1 ? full.size() : full.size() / width * width;
        for (std::size_t i = kept; i < full.size(); ++i) {
            Fan shorter = full[i];
            --shorter.length;
            of_length[length - 1].push_back(shorter);
            of_length[1].push_back(
                {shorter.a, shorter.b, {full[i].ring[length - 1], full[i].ring[length]}, 1, {full[i].tet[length - 1]}});
        }
        result.insert(result.end(), full.begin(), full.begin() + static_cast<std::ptrdiff_t>(kept));
    }
    return result;
}

class Builder {
public:
    Builder(const RestState& rest, std::vector<Patch> patches) : rest_(rest), patches_(std::move(patches)) {
        for (Patch& patch : patches_) patch.fan = filling_groups(patch.fan);
        layout_.corner.resize(index(rest.element_count()));
        layout_.batches.slot.resize(layout_.corner.size());
        layout_.nodes.place_begin.push_back(0);
        local_.resize(index(rest.node_count));
        number_nodes();
    }

    FanLayout build() {
        for (std::size_t p = 0; p < patches_.size(); ++p) add_patch(p);
        return std::move(layout_);
    }

private:
    const RestState& rest_;
    std::vector<Patch> patches_;
    std::vector<int> patches_of_node_;
    std::vector<std::vector<int>> order_;  // of each patch, see local_order
    std::vector<std::size_t> local_;       // mesh node → its number in the patch at hand
    FanLayout layout_;

    void number_nodes() {
        patches_of_node_.assign(index(rest_.node_count), 0);
        for (const Patch& patch : patches_)
            for (const int a : patch.node) ++patches_of_node_[index(a)];
        for (const Patch& patch : patches_) {
            order_.push_back(local_order(patch));
            for (const int a : order_.back())
                if (is_own(a)) layout_.mesh_node.push_back(a);
        }
        layout_.own_nodes = layout_.mesh_node.size();
        for (int a = 0; a < rest_.node_count; ++a)
            if (!is_own(a)) layout_.mesh_node.push_back(a);
        layout_.internal.resize(layout_.mesh_node.size());
        for (std::size_t i = 0; i < layout_.mesh_node.size(); ++i)
            layout_.internal[index(layout_.mesh_node[i])] = word(i);
    }

    /// Mesh nodes of a patch: own ones first, then by the number of places, so that loops over places keep their
    /// length.
    [[nodiscard]] std::vector<int> local_order(const Patch& patch) const {
        std::map<int, int> places;
        const auto count = [&](int number) { ++places[patch.node[index(number)]]; };
        for (const Fan& fan : patch.fan) {
            count(fan.a);
            count(fan.b);
            std::for_each(fan.ring.begin(), fan.ring.begin() + fan.length + 1, count);
        }
        std::vector<int> order = patch.node;
        std::stable_sort(order.begin(), order.end(), [&](int x, int y) {
            return std::pair(!is_own(x), -places[x]) < std::pair(!is_own(y), -places[y]);
        });
        return order;
    }

    [[nodiscard]] bool is_own(int a) const { return patches_of_node_[index(a)] == 1; }

    void add_patch(std::size_t p) {
        const Patch& patch = patches_[p];
        FanPatch entry;
        entry.material = index(patch.material);
        entry.first_group = layout_.groups.size();
        entry.first_fan_node = layout_.nodes.fan_node.size();
        entry.first_node = layout_.nodes.node.size();
        entry.node_count = patch.node.size();
        const std::vector<int>& order = order_[p];
        entry.own_count = static_cast<std::size_t>(
            std::partition_point(order.begin(), order.end(), [&](int a) { return is_own(a); }) - order.begin());
        entry.first_own = entry.own_count > 0 ? layout_.internal[index(order.front())] : 0;
        for (std::size_t i = 0; i < order.size(); ++i) {
            local_[index(order[i])] = i;
            layout_.nodes.node.push_back(layout_.internal[index(order[i])]);
        }
        add_groups(patch);
        entry.end_group = layout_.groups.size();
        add_pressure_nodes(patch, entry);
        add_places(entry);
        layout_.patches.push_back(entry);
    }

    using ElementOfNodes = std::multimap<std::array<int, 4>, int>;

    void add_groups(const Patch& patch) {
        ElementOfNodes elements;
        for (const int e : patch.tet) elements.emplace(sorted(nodes_of(e)), e);
        const std::vector<Fan>& fans = patch.fan;
        const std::size_t first_batch = layout_.batches.element.size() / width;
        const std::size_t first_fan_node = layout_.nodes.fan_node.size();
        for (std::size_t first = 0; first < fans.size(); first += width) {
            const int length = fans[first].length;
            const std::size_t batch = layout_.batches.element.size() / width;
            layout_.groups.push_back({batch, layout_.nodes.fan_node.size() - first_fan_node, length});
            layout_.batches.element.resize((batch + index(length)) * width, -1);
            layout_.nodes.fan_node.resize(layout_.nodes.fan_node.size() + index(length + 3) * width);
            for (std::size_t lane = 0; lane < width; ++lane)
                add_fan(patch, fans[std::min(first + lane, fans.size() - 1)], first + lane < fans.size(), lane,
                        elements);
        }
        std::vector<BatchBlock>& blocks = layout_.batches.blocks;
        if (blocks.empty() || blocks.back().material != patch.material)
            blocks.push_back({patch.material, first_batch, first_batch});
        blocks.back().end = layout_.batches.element.size() / width;
    }

    /// Lane of the last group; padding has nodes alone.
    void add_fan(const Patch& patch, const Fan& fan, bool real, std::size_t lane, ElementOfNodes& elements) {
        const FanGroup& group = layout_.groups.back();
        std::uint16_t* out =
            layout_.nodes.fan_node.data() + layout_.nodes.fan_node.size() - index(group.length + 3) * width + lane;
        const auto mesh_node = [&](int number) { return patch.node[index(number)]; };
        const auto set_node = [&](std::size_t place, int number) {
            out[place * width] = static_cast<std::uint16_t>(local_[index(mesh_node(number))]);
        };
        set_node(0, fan.a);
        set_node(1, fan.b);
        for (std::size_t k = 0; k <= index(group.length); ++k) set_node(2 + k, fan.ring[k]);
        if (!real) return;
        for (std::size_t k = 0; k < index(group.length); ++k) {
            const std::array<int, 4> nodes{mesh_node(fan.a), mesh_node(fan.b), mesh_node(fan.ring[k]),
                                           mesh_node(fan.ring[k + 1])};
            const int e = elements.extract(sorted(nodes)).mapped();
            const std::array<int, 4> rest_nodes = nodes_of(e);
            for (std::size_t c = 0; c < 4; ++c)
                layout_.corner[index(e)][c] =
                    static_cast<int>(std::find(rest_nodes.begin(), rest_nodes.end(), nodes[c]) - rest_nodes.begin());
            const std::size_t slot = (group.first_batch + k) * width + lane;
            layout_.batches.slot[index(e)] = slot;
            layout_.batches.element[slot] = e;
        }
    }

    void add_pressure_nodes(const Patch& patch, const FanPatch& entry) {
        if (rest_.pressure.count() == 0) return;
        layout_.nodes.pressure.resize(layout_.nodes.node.size());
        for (const int e : patch.tet)
            for (int k = 0; k < 4; ++k)
                layout_.nodes.pressure[entry.first_node + local_[index(rest_.nodes(k, e))]] =
                    word(index(rest_.pressure.of_element(k, e)));
    }

    void add_places(const FanPatch& entry) {
        std::vector<std::vector<std::uint16_t>> places(entry.node_count);
        for (std::size_t g = entry.first_group; g < layout_.groups.size(); ++g) {
            const FanGroup& group = layout_.groups[g];
            for (std::size_t k = 0; k < index(group.length + 3) * width; ++k) {
                if (layout_.batches.element[group.first_batch * width + k % width] < 0) continue;
                const std::size_t place = group.first_place + k;
                if (place > std::numeric_limits<std::uint16_t>::max())
                    throw InvalidInput("a patch of tetrahedra has more than 65536 nodes of fans: take smaller patches");
                places[layout_.nodes.fan_node[entry.first_fan_node + place]].push_back(
                    static_cast<std::uint16_t>(place));
            }
        }
        for (const std::vector<std::uint16_t>& of_node : places) {
            layout_.nodes.scalar_place.insert(layout_.nodes.scalar_place.end(), of_node.begin(), of_node.end());
            layout_.nodes.place_begin.push_back(word(layout_.nodes.scalar_place.size()));
        }
    }

    [[nodiscard]] std::array<int, 4> nodes_of(int e) const {
        return {rest_.nodes(0, e), rest_.nodes(1, e), rest_.nodes(2, e), rest_.nodes(3, e)};
    }
    static std::array<int, 4> sorted(std::array<int, 4> nodes) {
        std::sort(nodes.begin(), nodes.end());
        return nodes;
    }
};

}  // namespace

FanLayout fan_layout(const RestState& rest, int patch_tets) {
    return Builder(rest, cut_into_patches(rest, {patch_tets, most_of_a_fan})).build();
}

int suggested_patch_tets(int element_count) {
    return std::clamp(element_count / 16, 256, 2000);
}

}  // namespace tissuewarp::tled::detail
