#include "tled/model/patches.hpp"

#include "core/errors.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <unordered_map>

namespace tissuewarp::tled::detail {
namespace {

using Eigen::Matrix3Xd;

/// Around the edge (a < b) the tetrahedron (a, b, from, to).
struct Arc {
    int a, b, from, to, tet;
};

/// Corners of the tetrahedron after its edges' ends, such that (edge, rest) is an even permutation of (0, 1, 2, 3).
constexpr std::array<std::array<int, 4>, 6> even_orders{
    {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 2, 0}, {2, 3, 0, 1}}};

/// Sorted by edge.
std::vector<Arc> arcs_of(std::span<const std::array<int, 4>> tets) {
    std::vector<Arc> arcs;
    arcs.reserve(6 * tets.size());
    for (std::size_t t = 0; t < tets.size(); ++t)
        for (const auto& order : even_orders) {
            const auto corner = [&](std::size_t k) { return tets[t][static_cast<std::size_t>(order[k])]; };
            Arc arc{corner(0), corner(1), corner(2), corner(3), static_cast<int>(t)};
            if (arc.a > arc.b) {  // turning the edge around turns the ring around
                std::swap(arc.a, arc.b);
                std::swap(arc.from, arc.to);
            }
            arcs.push_back(arc);
        }
    std::sort(arcs.begin(), arcs.end(),
              [](const Arc& x, const Arc& y) { return std::tie(x.a, x.b, x.tet) < std::tie(y.a, y.b, y.tet); });
    return arcs;
}

/// The longest chain of unused tetrahedra around an edge in which each shares a face with the next, cut at `longest`.
class Chains {
public:
    Chains(std::size_t tets, int longest) : used_(tets, false), longest_(static_cast<std::size_t>(longest)) {}

    const std::vector<Arc>& find(std::span<const Arc> ring) {
        best_.clear();
        for (const Arc& first : ring) {
            if (used(first)) continue;
            chain_.assign(1, first);
            while (chain_.size() < longest_) {
                const auto next = std::find_if(ring.begin(), ring.end(), [&](const Arc& arc) {
                    return arc.from == chain_.back().to && !used(arc) && !in_chain(arc);
                });
                if (next == ring.end()) break;
                chain_.push_back(*next);
            }
            if (chain_.size() > best_.size()) best_ = chain_;
            if (best_.size() == longest_) break;
        }
        return best_;
    }

    void use(const std::vector<Arc>& chain) {
        for (const Arc& arc : chain) used_[static_cast<std::size_t>(arc.tet)] = true;
    }

private:
    [[nodiscard]] bool used(const Arc& arc) const { return used_[static_cast<std::size_t>(arc.tet)]; }
    [[nodiscard]] bool in_chain(const Arc& arc) const {
        return std::any_of(chain_.begin(), chain_.end(), [&](const Arc& each) { return each.tet == arc.tet; });
    }

    std::vector<bool> used_;
    std::size_t longest_;
    std::vector<Arc> chain_, best_;
};

Fan fan_of(const std::vector<Arc>& chain) {
    Fan fan{chain.front().a, chain.front().b, {}, static_cast<int>(chain.size()), {}};
    fan.ring[0] = chain.front().from;
    for (std::size_t i = 0; i < chain.size(); ++i) {
        fan.ring[i + 1] = chain[i].to;
        fan.tet[i] = chain[i].tet;
    }
    return fan;
}

/// Splits elements [begin, end) into `parts` of equal size and appends them as patches.
class Bisection {
public:
    Bisection(const Matrix3Xd& centroid, int material, std::vector<Patch>& patches)
        : centroid_(centroid), material_(material), patches_(patches) {}

    void split(std::span<int> elements, std::size_t parts) {
        if (parts <= 1) {
            Patch patch;
            patch.material = material_;
            patch.tet.assign(elements.begin(), elements.end());
            std::sort(patch.tet.begin(), patch.tet.end());
            patches_.push_back(std::move(patch));
            return;
        }
        const int axis = longest_side(elements);
        const std::size_t low = parts / 2, middle = elements.size() * low / parts;
        std::nth_element(elements.begin(), elements.begin() + static_cast<std::ptrdiff_t>(middle), elements.end(),
                         [&](int x, int y) {
                             const double p = centroid_(axis, x), q = centroid_(axis, y);
                             return p < q || (p == q && x < y);
                         });
        split(elements.first(middle), low);
        split(elements.subspan(middle), parts - low);
    }

private:
    [[nodiscard]] int longest_side(std::span<const int> elements) const {
        Eigen::AlignedBox3d box;
        for (const int e : elements) box.extend(Eigen::Vector3d(centroid_.col(e)));
        int axis = 0;
        box.sizes().maxCoeff(&axis);
        return axis;
    }

    const Matrix3Xd& centroid_;
    int material_;
    std::vector<Patch>& patches_;
};

Matrix3Xd centroids(const RestState& rest) {
    Matrix3Xd result(3, rest.element_count());
    for (int e = 0; e < rest.element_count(); ++e)
        result.col(e) = rest.position(Eigen::all, rest.nodes.col(e)).rowwise().mean();
    return result;
}

/// The patches that hold each node, ascending.
std::vector<std::vector<int>> sharers_of_nodes(const RestState& rest, const std::vector<Patch>& patches) {
    std::vector<std::vector<int>> sharers(static_cast<std::size_t>(rest.node_count));
    for (std::size_t p = 0; p < patches.size(); ++p)
        for (const int e : patches[p].tet)
            for (const int a : rest.nodes.col(e)) {
                std::vector<int>& of_node = sharers[static_cast<std::size_t>(a)];
                if (of_node.empty() || of_node.back() != static_cast<int>(p)) of_node.push_back(static_cast<int>(p));
            }
    return sharers;
}

/// Local numbers in the order of how many patches share the node, then of which, then of the mesh: what one patch takes
/// from another then lies together in both.
void number_nodes(const RestState& rest, const std::vector<std::vector<int>>& sharers, Patch& patch) {
    for (const int e : patch.tet)
        for (const int a : rest.nodes.col(e)) patch.node.push_back(a);
    std::sort(patch.node.begin(), patch.node.end());
    patch.node.erase(std::unique(patch.node.begin(), patch.node.end()), patch.node.end());
    std::stable_sort(patch.node.begin(), patch.node.end(), [&](int x, int y) {
        const std::vector<int>&p = sharers[static_cast<std::size_t>(x)], &q = sharers[static_cast<std::size_t>(y)];
        return p.size() != q.size() ? p.size() > q.size() : p < q;
    });
}

/// visit(place, node) for the local nodes of a fan in the order in which they are written to memory.
template <class Visit>
void visit_nodes(const Fan& fan, const Visit& visit) {
    visit(std::size_t{0}, fan.a);
    visit(std::size_t{1}, fan.b);
    for (std::size_t k = 0; k <= static_cast<std::size_t>(fan.length); ++k) visit(2 + k, fan.ring[k]);
}

/// Orders fans of equal length such that 32 neighbours, which a device computes side by side, add to different banks of
/// its shared memory (node modulo 32) where they can: greedily, among the next ones, the fan with the fewest conflicts.
std::vector<Fan> spread_over_banks(std::vector<Fan> fans) {
    constexpr std::size_t lanes = 32, candidates = 128;
    using Banks = std::array<std::array<int, lanes>, most_of_a_fan + 3>;
    Banks banks{};
    for (std::size_t i = 0; i < fans.size(); ++i) {
        if (i % lanes == 0) banks = {};
        std::size_t best = i;
        int fewest = std::numeric_limits<int>::max();
        for (std::size_t j = i; j < std::min(fans.size(), i + candidates) && fewest > 0; ++j) {
            if (fans[j].length != fans[i].length) break;
            int conflicts = 0;
            visit_nodes(fans[j], [&](std::size_t place, int node) {
                const int taken = banks[place][static_cast<std::size_t>(node) % lanes];
                conflicts += taken * taken;
            });
            if (conflicts < fewest) {
                fewest = conflicts;
                best = j;
            }
        }
        std::swap(fans[i], fans[best]);
        visit_nodes(fans[i],
                    [&](std::size_t place, int node) { ++banks[place][static_cast<std::size_t>(node) % lanes]; });
    }
    return fans;
}

void find_fans(const RestState& rest, int longest, Patch& patch) {
    std::unordered_map<int, int> local;
    for (std::size_t i = 0; i < patch.node.size(); ++i) local[patch.node[i]] = static_cast<int>(i);
    std::vector<std::array<int, 4>> tets;
    tets.reserve(patch.tet.size());
    for (const int e : patch.tet) {
        const auto node = [&](int k) { return local[rest.nodes(k, e)]; };
        tets.push_back({node(0), node(1), node(2), node(3)});
    }
    patch.fan = spread_over_banks(fans_of(tets, longest));
}

}  // namespace

std::vector<Fan> fans_of(std::span<const std::array<int, 4>> tets, int longest) {
    const std::vector<Arc> arcs = arcs_of(tets);
    std::vector<std::span<const Arc>> rings;
    for (std::size_t i = 0; i < arcs.size();) {
        std::size_t end = i;
        while (end < arcs.size() && arcs[end].a == arcs[i].a && arcs[end].b == arcs[i].b) ++end;
        rings.emplace_back(arcs.data() + i, end - i);
        i = end;
    }
    Chains chains(tets.size(), longest);
    std::vector<Fan> fans;
    for (int length = longest; length >= 1; --length)
        for (const std::span<const Arc> ring : rings) {
            if (ring.size() < static_cast<std::size_t>(length)) continue;
            for (const std::vector<Arc>* chain = &chains.find(ring); static_cast<int>(chain->size()) >= length;
                 chain = &chains.find(ring)) {
                fans.push_back(fan_of(*chain));
                chains.use(*chain);
            }
        }
    return fans;
}

std::vector<Patch> cut_into_patches(const RestState& rest, const PatchShape& shape) {
    if (shape.tets < 1 || shape.longest_fan < 1 || shape.longest_fan > most_of_a_fan)
        throw InvalidInput("patches of " + std::to_string(shape.tets) + " tetrahedra in fans of " +
                           std::to_string(shape.longest_fan) + ": take at least 1, and fans of 1 to " +
                           std::to_string(most_of_a_fan));
    const Matrix3Xd centroid = centroids(rest);
    std::vector<Patch> patches;
    for (const MaterialBlock& block : rest.blocks) {
        std::vector<int> elements(static_cast<std::size_t>(block.end - block.begin));
        std::iota(elements.begin(), elements.end(), block.begin);
        const auto most = static_cast<std::size_t>(shape.tets);
        Bisection(centroid, block.material, patches).split(elements, (elements.size() + most - 1) / most);
    }
    const std::vector<std::vector<int>> sharers = sharers_of_nodes(rest, patches);
    parallel_for(0, static_cast<int>(patches.size()), [&](int p) {
        Patch& patch = patches[static_cast<std::size_t>(p)];
        number_nodes(rest, sharers, patch);
        find_fans(rest, shape.longest_fan, patch);
    });
    return patches;
}

}  // namespace tissuewarp::tled::detail
