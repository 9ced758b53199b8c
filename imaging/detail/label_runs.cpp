#include "imaging/detail/label_runs.hpp"

#include <algorithm>
#include <numeric>

namespace tissuewarp::imaging::detail {

namespace {

/// Disjoint sets; the smallest member is the root, so numbering does not depend on the order of unions.
class DisjointSets {
public:
    explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }

    int root(int a) {
        while (parent_[static_cast<std::size_t>(a)] != a) {
            int& parent = parent_[static_cast<std::size_t>(a)];
            a = parent = parent_[static_cast<std::size_t>(parent)];  // path halving
        }
        return a;
    }

    void join(int a, int b) {
        a = root(a);
        b = root(b);
        parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }

private:
    std::vector<int> parent_;
};

/// Joins runs of two neighbouring rows where equal labels touch. Ranges are indices into `runs`.
void join_rows(const std::vector<LabelRun>& runs, int a, int a_end, int b, int b_end, DisjointSets& sets) {
    while (a < a_end && b < b_end) {
        const LabelRun &first = runs[static_cast<std::size_t>(a)], &second = runs[static_cast<std::size_t>(b)];
        if (first.label == second.label && first.begin < second.end && second.begin < first.end) sets.join(a, b);
        (first.end < second.end ? a : b)++;
    }
}

}  // namespace

std::vector<LabelRun> connected_runs(const Volume& labels) {
    const auto [nx, ny, nz] = labels.geometry.size;
    std::vector<LabelRun> runs;
    std::vector<int> first_of_row;  // index of the first run of each row, rows in memory order
    first_of_row.reserve(static_cast<std::size_t>(ny) * static_cast<std::size_t>(nz) + 1);
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j) {
            first_of_row.push_back(static_cast<int>(runs.size()));
            const int* row = labels.data<int>() + labels.offset(0, j, k);
            for (int i = 0; i < nx;) {
                const int begin = i, label = row[i];
                while (i < nx && row[i] == label) ++i;
                if (label != 0) runs.push_back({begin, i, j, k, label, 0});
            }
        }
    first_of_row.push_back(static_cast<int>(runs.size()));

    DisjointSets sets(runs.size());
    const auto join = [&](int row, int neighbour) {
        const auto a = static_cast<std::size_t>(row), b = static_cast<std::size_t>(neighbour);
        join_rows(runs, first_of_row[a], first_of_row[a + 1], first_of_row[b], first_of_row[b + 1], sets);
    };
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j) {
            if (j > 0) join(j + ny * k, j - 1 + ny * k);
            if (k > 0) join(j + ny * k, j + ny * (k - 1));
        }
    int pieces = 0;
    for (std::size_t r = 0; r < runs.size(); ++r) {
        const int root = sets.root(static_cast<int>(r));
        runs[r].piece = root == static_cast<int>(r) ? pieces++ : runs[static_cast<std::size_t>(root)].piece;
    }
    return runs;
}

}  // namespace tissuewarp::imaging::detail
