#include "tled/error/hierarchical_space.hpp"

#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

namespace {

struct Occurrence {
    int smaller, larger, entry;  // entry: 6·element + place
    auto operator<=>(const Occurrence&) const = default;
};

}  // namespace

HierarchicalSpace hierarchical_space(const Eigen::Matrix4Xi& tets, int corner_count) {
    std::vector<Occurrence> occurrences(6 * static_cast<std::size_t>(tets.cols()));
    for (int e = 0; e < tets.cols(); ++e) {
        for (int k = 0; k < 6; ++k) {
            const auto [smaller, larger] =
                std::minmax(tets(tetrahedron_edges[k][0], e), tets(tetrahedron_edges[k][1], e));
            occurrences[6 * static_cast<std::size_t>(e) + static_cast<std::size_t>(k)] = {smaller, larger, 6 * e + k};
        }
    }
    tbb::parallel_sort(occurrences.begin(), occurrences.end());

    HierarchicalSpace space;
    space.corner_count = corner_count;
    space.edge_of.resize(6, tets.cols());
    space.incidence.entry.reserve(occurrences.size());
    std::vector<int> corners;
    for (std::size_t k = 0; k < occurrences.size(); ++k) {
        const Occurrence& here = occurrences[k];
        if (k == 0 || here.smaller != occurrences[k - 1].smaller || here.larger != occurrences[k - 1].larger) {
            space.incidence.offset.push_back(static_cast<int>(k));
            corners.insert(corners.end(), {here.smaller, here.larger});
        }
        space.edge_of.reshaped()[here.entry] = static_cast<int>(space.incidence.offset.size()) - 1;
        space.incidence.entry.push_back(here.entry);
    }
    space.incidence.offset.push_back(static_cast<int>(occurrences.size()));
    space.edge = Eigen::Map<const Eigen::Matrix2Xi>(corners.data(), 2, static_cast<Eigen::Index>(corners.size()) / 2);
    return space;
}

int HierarchicalSpace::edge_between(int a, int b) const {
    const auto [smaller, larger] = std::minmax(a, b);
    int first = 0, last = edge_count();
    while (first < last) {
        const int middle = first + (last - first) / 2;
        if (std::pair(edge(0, middle), edge(1, middle)) < std::pair(smaller, larger)) {
            first = middle + 1;
        } else {
            last = middle;
        }
    }
    const bool found = first < edge_count() && edge(0, first) == smaller && edge(1, first) == larger;
    return found ? first : -1;
}

}  // namespace tissuewarp::tled::detail
