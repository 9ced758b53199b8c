#include "tled/stiffness/supernodes.hpp"

#include "tled/parallel/parallel.hpp"

#include <oneapi/tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>

extern "C" {
void dgemm_(const char* transpose_a, const char* transpose_b, const int* m, const int* n, const int* k,
            const double* alpha, const double* a, const int* lda, const double* b, const int* ldb, const double* beta,
            double* c, const int* ldc);
void dgemv_(const char* transpose, const int* m, const int* n, const double* alpha, const double* a, const int* lda,
            const double* x, const int* incx, const double* beta, double* y, const int* incy);
void dtrsm_(const char* side, const char* uplo, const char* transpose, const char* diagonal, const int* m, const int* n,
            const double* alpha, const double* a, const int* lda, double* b, const int* ldb);
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
}

namespace tissuewarp::tled::detail {

namespace {

constexpr int tile = 64;                  // columns of a tile
constexpr int tall = 192;                 // its rows, where rows are shared out
constexpr int stretch = 512;              // rows of a tile that earlier supernodes are subtracted from at once
constexpr double tiled_operations = 4e6;  // of a supernode whose tiles are shared out: a millisecond
constexpr double least_branch = 2e6;      // operations of a branch that one thread takes as a whole
constexpr double branches = 200;          // about, of a tree
constexpr int columns_at_once = 16;       // of a solve

/// c ← beta c + alpha a bᵀ.
void multiply(double alpha, const double* a, int lda, const double* b, int ldb, double beta, double* c, int ldc, int m,
              int n, int k) {
    dgemm_("N", "T", &m, &n, &k, &alpha, a, &lda, b, &ldb, &beta, c, &ldc);
}

/// y ← a x or, transposed, aᵀ x, of k columns. a has m rows and `inner` columns, or the other way round.
void multiply_columns(const double* a, int lda, bool transposed, const double* x, int ldx, double* y, int ldy, int m,
                      int k, int inner) {
    constexpr double one = 1, zero = 0;
    constexpr int step = 1;
    const char* as = transposed ? "T" : "N";
    if (k > 1)
        dgemm_(as, "N", &m, &k, &inner, &one, a, &lda, x, &ldx, &zero, y, &ldy);
    else
        dgemv_(as, transposed ? &inner : &m, transposed ? &m : &inner, &one, a, &lda, x, &step, &zero, y, &step);
}

/// x ← L⁻¹ x or, transposed, L⁻ᵀ x, of k columns.
void divide_columns(const double* L, int ldl, bool transposed, double* x, int ldx, int n, int k) {
    constexpr double one = 1;
    dtrsm_("L", "L", transposed ? "T" : "N", "N", &n, &k, &one, L, &ldl, x, &ldx);
}

bool factorise_dense(double* a, int n, int lda) {
    int info = 0;
    dpotrf_("L", &n, a, &lda, &info);
    return info == 0;
}

/// b ← b L⁻ᵀ.
void divide_rows(const double* L, int ldl, double* b, int ldb, int m, int n) {
    constexpr double one = 1;
    dtrsm_("R", "L", "T", "N", &m, &n, &one, L, &ldl, b, &ldb);
}

/// body(i) for 0 ≤ i < count, shared out or not.
template <class Body>
void each(bool shared, int count, const Body& body) {
    if (shared)
        parallel_for(0, count, body);
    else
        for (int i = 0; i < count; ++i) body(i);
}

int pieces(int length, int of) {
    return (length + of - 1) / of;
}

}  // namespace

SupernodeTree::SupernodeTree(Supernodes supernodes, const int* order, int n)
    : supernodes_(std::move(supernodes)),
      place_(static_cast<std::size_t>(n)),
      supernode_of_(static_cast<std::size_t>(n)) {
    for (int k = 0; k < n; ++k) place_[static_cast<std::size_t>(order[k])] = k;
    for (int s = 0; s < supernodes_.count(); ++s)
        std::fill(supernode_of_.begin() + supernodes_.begin(s), supernode_of_.begin() + supernodes_.end(s), s);
    list_updates();
    make_tasks();
}

/// Of each supernode, in the order of those that they come from.
void SupernodeTree::list_updates() {
    const auto count = static_cast<std::size_t>(supernodes_.count());
    parent_.assign(count, -1);
    first_update_.assign(count + 1, 0);
    work_.assign(count, 0);
    const auto each_update = [&](const auto& take) {
        for (int s = 0; s < supernodes_.count(); ++s) {
            const int* rows = supernodes_.rows(s);
            for (int begin = supernodes_.columns(s), height = supernodes_.height(s); begin < height;) {
                const int to = supernode_of_[static_cast<std::size_t>(rows[begin])];
                const int end = int(std::lower_bound(rows + begin, rows + height, supernodes_.end(to)) - rows);
                take(to, Update{s, begin, end});
                begin = end;
            }
        }
    };
    each_update([&](int to, const Update& update) {
        const auto from = static_cast<std::size_t>(update.from);
        if (parent_[from] < 0) parent_[from] = to;
        ++first_update_[static_cast<std::size_t>(to) + 1];
        work_[static_cast<std::size_t>(to)] += 2.0 * supernodes_.columns(update.from) * (update.end - update.begin) *
                                               (supernodes_.height(update.from) - update.begin);
    });
    for (std::size_t s = 0; s < count; ++s) first_update_[s + 1] += first_update_[s];
    updates_.resize(static_cast<std::size_t>(first_update_.back()));
    std::vector<int> next(first_update_.begin(), first_update_.end() - 1);
    each_update([&](int to, const Update& update) {
        updates_[static_cast<std::size_t>(next[static_cast<std::size_t>(to)]++)] = update;
    });
    for (int s = 0; s < supernodes_.count(); ++s) {
        const double columns = supernodes_.columns(s), below = supernodes_.height(s) - columns;
        work_[static_cast<std::size_t>(s)] += columns * columns * (columns / 3 + below);
    }
}

/// Branches of little work are one task each, supernodes below them another each. Numbers of a branch follow each
/// other, since CHOLMOD numbers in postorder.
void SupernodeTree::make_tasks() {
    const auto count = static_cast<std::size_t>(supernodes_.count());
    std::vector<double> branch = work_;
    std::vector<int> first(count);
    for (std::size_t s = 0; s < count; ++s) first[s] = static_cast<int>(s);
    double all = 0;
    for (std::size_t s = 0; s < count; ++s) {  // children come before their parents
        all += work_[s];
        if (parent_[s] < 0) continue;
        const auto p = static_cast<std::size_t>(parent_[s]);
        branch[p] += branch[s];
        first[p] = std::min(first[p], first[s]);
    }
    const double most = std::max(least_branch, all / branches);
    const auto is_small = [&](std::size_t s) { return branch[s] <= most; };
    std::vector<int> task_of(count, -1);
    for (std::size_t s = 0; s < count; ++s) {
        if (is_small(s) && parent_[s] >= 0 && is_small(static_cast<std::size_t>(parent_[s]))) continue;
        task_of[s] = static_cast<int>(tasks_.size());
        tasks_.push_back({is_small(s) ? first[s] : static_cast<int>(s), static_cast<int>(s)});
    }
    children_.resize(tasks_.size());
    for (std::size_t t = 0; t < tasks_.size(); ++t) {
        const int below = parent_[static_cast<std::size_t>(tasks_[t].last)];
        if (below < 0) continue;
        tasks_[t].parent = task_of[static_cast<std::size_t>(below)];
        ++tasks_[static_cast<std::size_t>(tasks_[t].parent)].waits_for;
        children_[static_cast<std::size_t>(tasks_[t].parent)].push_back(static_cast<int>(t));
    }
}

/// visit(s) for every supernode after those of its branches.
template <class Visit>
void SupernodeTree::leaves_to_roots(const Visit& visit) const {
    const ForkJoin order;
    const std::unique_ptr<std::atomic<int>[]> waits(new std::atomic<int>[tasks_.size()]);
    for (std::size_t t = 0; t < tasks_.size(); ++t) waits[t] = tasks_[t].waits_for;
    tbb::task_group group;
    const auto run = [&](int task) {
        for (int t = task; t >= 0;) {
            const Task& now = tasks_[static_cast<std::size_t>(t)];
            order.enter();
            for (int s = now.first; s <= now.last; ++s) visit(s);
            order.leave();
            if (now.parent < 0 || --waits[static_cast<std::size_t>(now.parent)] > 0) return;
            t = now.parent;
        }
    };
    for (std::size_t t = 0; t < tasks_.size(); ++t)
        if (tasks_[t].waits_for == 0) group.run([&run, t] { run(static_cast<int>(t)); });
    group.wait();
    order.joined();
}

/// visit(s) for every supernode after the one below it.
template <class Visit>
void SupernodeTree::roots_to_leaves(const Visit& visit) const {
    const ForkJoin order;
    tbb::task_group group;
    const auto run = [&](auto&& self, int task) -> void {
        const Task& now = tasks_[static_cast<std::size_t>(task)];
        order.enter();
        for (int s = now.last; s >= now.first; --s) visit(s);
        order.leave();
        for (const int child : children_[static_cast<std::size_t>(task)])
            group.run([&self, child] { self(self, child); });
    };
    for (std::size_t t = 0; t < tasks_.size(); ++t)
        if (tasks_[t].parent < 0) group.run([&run, t] { run(run, static_cast<int>(t)); });
    group.wait();
    order.joined();
}

/// Entries of the matrix to their places in L, everything else 0.
void SupernodeTree::scatter(const Eigen::SparseMatrix<double>& lower, double* values) const {
    constexpr std::size_t grain = 1 << 16;
    parallel_ranges(0, supernodes_.values_of(supernodes_.count()), grain,
                    [&](std::size_t begin, std::size_t end) { std::fill(values + begin, values + end, 0.0); });
    parallel_for(0, static_cast<int>(lower.outerSize()), [&](int j) {
        const int own = place_[static_cast<std::size_t>(j)];
        for (Eigen::SparseMatrix<double>::InnerIterator entry(lower, j); entry; ++entry) {
            const int other = place_[static_cast<std::size_t>(entry.row())];
            const int column = std::min(own, other), s = supernode_of_[static_cast<std::size_t>(column)];
            const int *rows = supernodes_.rows(s), height = supernodes_.height(s);
            const auto row = std::lower_bound(rows, rows + height, std::max(own, other)) - rows;
            values[supernodes_.values_of(s) + std::size_t(column - supernodes_.begin(s)) * std::size_t(height) +
                   std::size_t(row)] = entry.value();
        }
    });
}

namespace {

/// One supernode, its columns in tiles.
struct Front {
    const Supernodes& all;
    double* values;
    int s;
    bool shared;  // whether several threads take its tiles

    [[nodiscard]] int height() const { return all.height(s); }
    [[nodiscard]] double* at(int row, int column) const {
        return values + all.values_of(s) + std::size_t(column) * std::size_t(height()) + row;
    }
    [[nodiscard]] int tiles() const { return pieces(all.columns(s), tile); }
    [[nodiscard]] int width(int t) const { return std::min(tile, all.columns(s) - t * tile); }

    [[nodiscard]] int stretches() const { return pieces(height(), stretch); }

    /// In tile t and a stretch of the rows, less the products of rows of an earlier supernode, from `begin` on and of
    /// those before `end`.
    void subtract(int from, int begin, int end, int t, int part) const;
    /// Tiles from left to right: factorise, divide what is below, subtract from those to the right.
    [[nodiscard]] bool factorise() const;
};

void Front::subtract(int from, int begin, int end, int t, int part) const {
    const int *rows = all.rows(from), *own = all.rows(s), first = all.begin(s) + t * tile;
    const auto row_from = [&](int row) { return int(std::lower_bound(rows + begin, rows + end, row) - rows); };
    const int left = row_from(first), right = row_from(first + width(t)), n = right - left;
    if (n == 0) return;
    end = all.height(from);
    const int next = (part + 1) * stretch,
              top = std::max(left, row_from(own[part * stretch])),  // nothing above the diagonal
        m = (next < height() ? row_from(own[next]) : end) - top;
    if (m <= 0) return;
    thread_local std::vector<double> product;  // kept: its pages cost as much as what is done with them
    thread_local std::vector<int> place;       // of rows in this front
    product.resize(std::size_t(m) * std::size_t(n));
    place.resize(std::size_t(m));
    for (int r = 0, at = part * stretch; r < m; ++r, ++at) {
        if (own[at] != rows[top + r]) at = int(std::lower_bound(own + at, own + height(), rows[top + r]) - own);
        place[std::size_t(r)] = at;
    }
    const double* block = values + all.values_of(from);
    const int ld = all.height(from);
    multiply(1, block + top, ld, block + left, ld, 0, product.data(), m, m, n, all.columns(from));
    for (int c = 0; c < n; ++c) {
        double* column = at(0, rows[left + c] - all.begin(s));
        const double* there = product.data() + std::size_t(c) * std::size_t(m);
        for (int r = std::max(0, left + c - top); r < m; ++r) column[place[std::size_t(r)]] -= there[r];
    }
}

bool Front::factorise() const {
    const int rows = height();
    for (int t = 0; t < tiles(); ++t) {
        const int begin = t * tile, wide = width(t), below = begin + wide, tallest = pieces(rows - below, tall);
        if (!factorise_dense(at(begin, begin), wide, rows)) return false;
        each(shared, tallest, [&](int piece) {
            const int row = below + piece * tall;
            divide_rows(at(begin, begin), rows, at(row, begin), rows, std::min(tall, rows - row), wide);
        });
        each(shared, (tiles() - t - 1) * tallest, [&](int n) {
            const int other = t + 1 + n / tallest, top = other * tile, row = top + n % tallest * tall;
            if (row >= rows) return;
            multiply(-1, at(row, begin), rows, at(top, begin), rows, 1, at(row, top), rows, std::min(tall, rows - row),
                     width(other), wide);
        });
    }
    return true;
}

}  // namespace

bool SupernodeTree::factorise(const Eigen::SparseMatrix<double>& lower, double* values) const {
    scatter(lower, values);
    std::atomic<bool> definite = true;
    leaves_to_roots([&](int s) {
        if (!definite) return;
        const Front front{supernodes_, values, s, work_[std::size_t(s)] > tiled_operations};
        each(front.shared, front.tiles() * front.stretches(), [&](int n) {
            for (int u = first_update_[std::size_t(s)]; u < first_update_[std::size_t(s) + 1]; ++u) {
                const Update& update = updates_[std::size_t(u)];
                front.subtract(update.from, update.begin, update.end, n / front.stretches(), n % front.stretches());
            }
        });
        if (!front.factorise()) definite = false;
    });
    return definite;
}

/// x of the columns of s, less what earlier ones put on them, by the triangle of s.
void SupernodeTree::solve_lower(const double* values, int s, Eigen::Ref<Eigen::MatrixXd> x) const {
    const int begin = supernodes_.begin(s), n = supernodes_.columns(s), k = int(x.cols()), ldx = int(x.outerStride());
    thread_local Eigen::MatrixXd product;
    for (int u = first_update_[std::size_t(s)]; u < first_update_[std::size_t(s) + 1]; ++u) {
        const Update& update = updates_[std::size_t(u)];
        const int from = update.from, m = update.end - update.begin, *rows = supernodes_.rows(from) + update.begin;
        product.resize(m, k);
        multiply_columns(values + supernodes_.values_of(from) + update.begin, supernodes_.height(from), false,
                         &x(supernodes_.begin(from), 0), ldx, product.data(), m, m, k, supernodes_.columns(from));
        for (int c = 0; c < k; ++c)
            for (int r = 0; r < m; ++r) x(rows[r], c) -= product(r, c);
    }
    divide_columns(values + supernodes_.values_of(s), supernodes_.height(s), false, &x(begin, 0), ldx, n, k);
}

/// The same upwards: less what the rows below bear on them.
void SupernodeTree::solve_upper(const double* values, int s, Eigen::Ref<Eigen::MatrixXd> x) const {
    const int begin = supernodes_.begin(s), n = supernodes_.columns(s), height = supernodes_.height(s),
              below = height - n, k = int(x.cols()), ldx = int(x.outerStride());
    const double* block = values + supernodes_.values_of(s);
    thread_local Eigen::MatrixXd there, product;
    if (below > 0) {
        there.resize(below, k);
        product.resize(n, k);
        for (int c = 0; c < k; ++c)
            for (int r = 0; r < below; ++r) there(r, c) = x(supernodes_.rows(s)[n + r], c);
        multiply_columns(block + n, height, true, there.data(), below, product.data(), n, n, k, below);
        x.middleRows(begin, n) -= product;
    }
    divide_columns(block, height, true, &x(begin, 0), ldx, n, k);
}

Eigen::MatrixXd SupernodeTree::solve(const double* values, const Eigen::MatrixXd& columns) const {
    const Eigen::Index n = columns.rows();
    Eigen::MatrixXd x(n, columns.cols()), result(n, columns.cols());
    parallel_for(0, pieces(int(columns.cols()), columns_at_once), [&](int piece) {
        const int first = piece * columns_at_once, count = std::min(columns_at_once, int(columns.cols()) - first);
        for (int c = first; c < first + count; ++c)
            for (Eigen::Index k = 0; k < n; ++k) x(place_[std::size_t(k)], c) = columns(k, c);
        auto some = x.middleCols(first, count);
        leaves_to_roots([&](int s) { solve_lower(values, s, some); });
        roots_to_leaves([&](int s) { solve_upper(values, s, some); });
        for (int c = first; c < first + count; ++c)
            for (Eigen::Index k = 0; k < n; ++k) result(k, c) = x(place_[std::size_t(k)], c);
    });
    return result;
}

}  // namespace tissuewarp::tled::detail
