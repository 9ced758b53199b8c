#include "tled/stiffness/cholmod_factor.hpp"

#include <cholmod.h>

#include <algorithm>
#include <memory>
#include <string>

#include "core/errors.hpp"
#include "tled/blas_threads.hpp"
#include "tled/stiffness/supernodes.hpp"

namespace tissuewarp::tled::detail {

namespace {

// A view of an Eigen matrix; CHOLMOD does not write through it.
cholmod_sparse view(const Eigen::SparseMatrix<double>& lower) {
    cholmod_sparse A{};
    A.nrow = lower.rows();
    A.ncol = lower.cols();
    A.nzmax = lower.nonZeros();
    A.p = const_cast<int*>(lower.outerIndexPtr());
    A.i = const_cast<int*>(lower.innerIndexPtr());
    A.x = const_cast<double*>(lower.valuePtr());
    A.stype = -1;
    A.itype = CHOLMOD_INT;
    A.xtype = CHOLMOD_REAL;
    A.dtype = CHOLMOD_DOUBLE;
    A.sorted = 1;
    A.packed = 1;
    return A;
}

cholmod_dense view(const Eigen::MatrixXd& columns) {
    cholmod_dense b{};
    b.nrow = b.d = columns.rows();
    b.ncol = columns.cols();
    b.nzmax = columns.size();
    b.x = const_cast<double*>(columns.data());
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    return b;
}

// Lower triangle of the node graph of a matrix, as a pattern with unit values.
Eigen::SparseMatrix<double> node_graph(const Eigen::SparseMatrix<double>& lower, const std::vector<int>& node_of,
                                       int node_count) {
    Eigen::SparseMatrix<double> graph(node_count, node_count);
    std::vector<int> outer{0}, inner;
    for (int column = 0; column < lower.cols(); ++column) {
        if (column > 0 && node_of[column] == node_of[column - 1]) continue;  // the first one reaches every row below
        const std::size_t begin = inner.size();
        for (Eigen::SparseMatrix<double>::InnerIterator it(lower, column); it; ++it) {
            const int row = node_of[it.row()];
            if (inner.size() == begin || inner.back() != row) inner.push_back(row);
        }
        outer.push_back(static_cast<int>(inner.size()));
    }
    graph.resizeNonZeros(static_cast<int>(inner.size()));
    std::copy(outer.begin(), outer.end(), graph.outerIndexPtr());
    std::copy(inner.begin(), inner.end(), graph.innerIndexPtr());
    std::fill_n(graph.valuePtr(), inner.size(), 1.0);
    return graph;
}

Supernodes supernodes_of(const cholmod_factor& L) {
    const auto copied = [&](const void* values, std::size_t count) {
        return std::vector<int>(static_cast<const int*>(values), static_cast<const int*>(values) + count);
    };
    return {copied(L.super, L.nsuper + 1), copied(L.pi, L.nsuper + 1), copied(L.px, L.nsuper + 1),
            copied(L.s, L.ssize)};
}

}  // namespace

struct CholmodFactor::Impl {
    mutable cholmod_common common{};
    cholmod_factor* symbolic = nullptr;
    cholmod_factor* L = nullptr;
    std::shared_ptr<const SupernodeTree> tree;
    mutable cholmod_dense *x = nullptr, *y = nullptr, *e = nullptr;  // workspaces of cholmod_solve2
    double solves_per_factor = 0;

    Impl() {
        cholmod_start(&common);
        common.print = 0;
        common.supernodal = CHOLMOD_SUPERNODAL;
        common.quick_return_if_not_posdef = 1;
        // Supernodes of nodes with three components: merge more of the small ones, waste less in the large ones. About
        // 10 % faster than the defaults on a box of 48 k tetrahedra.
        for (std::size_t& columns : common.nrelax) columns *= 4;
        for (double& waste : common.zrelax) waste *= 0.5;
    }
    ~Impl() {
        cholmod_free_dense(&x, &common);
        cholmod_free_dense(&y, &common);
        cholmod_free_dense(&e, &common);
        cholmod_free_factor(&L, &common);
        cholmod_free_factor(&symbolic, &common);
        cholmod_finish(&common);
    }
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    /// False where the matrix is not positive definite.
    [[nodiscard]] bool factorised(const Eigen::SparseMatrix<double>& lower) {
        const SingleBlasThread single;
        if (single.holds()) {
            cholmod_change_factor(CHOLMOD_REAL, 1, 1, 1, 1, L, &common);
            require_success("factorise");
            return tree->factorise(lower, static_cast<double*>(L->x));
        }
        cholmod_sparse matrix = view(lower);
        const SerialOpenMp serial;
        cholmod_factorize(&matrix, L, &common);
        require_success("factorise");
        return common.status != CHOLMOD_NOT_POSDEF;
    }

    [[nodiscard]] Eigen::MatrixXd solved(const Eigen::MatrixXd& b) const {
        const SingleBlasThread single;
        if (single.holds()) return tree->solve(static_cast<const double*>(L->x), b);
        cholmod_dense right = view(b);
        const SerialOpenMp serial;
        cholmod_solve2(CHOLMOD_A, L, &right, nullptr, &x, nullptr, &y, &e, &common);
        require_success("solve with");
        return Eigen::Map<const Eigen::MatrixXd>(static_cast<const double*>(x->x), b.rows(), b.cols());
    }

    void require_success(const char* step) const {
        if (common.status >= CHOLMOD_OK) return;
        if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE) {
            throw SolverFailure(std::string("not enough memory to ") + step + " the stiffness: use a coarser mesh");
        }
        throw SolverFailure(std::string("CHOLMOD failed to ") + step + " the stiffness, status " +
                            std::to_string(common.status));
    }
};

CholmodFactor::CholmodFactor(const Eigen::SparseMatrix<double>& lower, const std::vector<int>& node_of)
    : impl_(std::make_unique<Impl>()) {
    cholmod_common& common = impl_->common;
    // Consecutive numbers for the nodes that own a degree of freedom.
    std::vector<int> compact(node_of.size());
    std::vector<int> first;  // first degree of freedom of each, with an end mark
    for (std::size_t d = 0; d < node_of.size(); ++d) {
        if (d == 0 || node_of[d] != node_of[d - 1]) first.push_back(static_cast<int>(d));
        compact[d] = static_cast<int>(first.size()) - 1;
    }
    const int node_count = static_cast<int>(first.size());
    first.push_back(static_cast<int>(node_of.size()));

    const Eigen::SparseMatrix<double> graph = node_graph(lower, compact, node_count);
    cholmod_sparse graph_view = view(graph);
    std::vector<int> node_order(node_count), order;
    // Nested dissection factorises a box of 48 k tetrahedra 1.6 (T4) and 1.3 times (averaged pressure) as fast as
    // minimum degree, but gains nothing on tiny graphs.
    if (node_count < 200) {
        cholmod_amd(&graph_view, nullptr, 0, node_order.data(), &common);
    } else {
        cholmod_metis(&graph_view, nullptr, 0, 1, node_order.data(), &common);
    }
    impl_->require_success("order");
    order.reserve(node_of.size());
    for (int node : node_order) {
        for (int d = first[node]; d < first[node + 1]; ++d) order.push_back(d);
    }

    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
    common.postorder = 1;
    cholmod_sparse matrix = view(lower);
    impl_->symbolic = cholmod_analyze_p(&matrix, order.data(), nullptr, 0, &common);
    impl_->require_success("analyse");
    impl_->tree = std::make_shared<const SupernodeTree>(supernodes_of(*impl_->symbolic),
                                                        static_cast<const int*>(impl_->symbolic->Perm),
                                                        static_cast<int>(lower.cols()));
    constexpr double operations_per_entry = 30;  // of a factorisation in the time in which a solve reads an entry twice
    impl_->solves_per_factor = common.fl / (operations_per_entry * common.lnz);
}

CholmodFactor::CholmodFactor(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CholmodFactor::~CholmodFactor() = default;
CholmodFactor::CholmodFactor(CholmodFactor&&) noexcept = default;
CholmodFactor& CholmodFactor::operator=(CholmodFactor&&) noexcept = default;

CholmodFactor CholmodFactor::analysis() const {
    auto copy = std::make_unique<Impl>();
    copy->symbolic = cholmod_copy_factor(impl_->symbolic, &copy->common);
    copy->require_success("copy the analysis of");
    copy->tree = impl_->tree;
    copy->solves_per_factor = impl_->solves_per_factor;
    return CholmodFactor(std::move(copy));
}

bool CholmodFactor::factorize(const Eigen::SparseMatrix<double>& lower) {
    cholmod_free_factor(&impl_->L, &impl_->common);
    impl_->common.status = CHOLMOD_OK;
    impl_->L = cholmod_copy_factor(impl_->symbolic, &impl_->common);
    impl_->require_success("copy the analysis of");
    return impl_->factorised(lower);
}

Eigen::VectorXd CholmodFactor::solve(const Eigen::VectorXd& b) const {
    return solve_columns(b);
}

Eigen::MatrixXd CholmodFactor::solve_columns(const Eigen::MatrixXd& b) const {
    return impl_->solved(b);
}

// A⁻¹ between them is YᵀY of L Y = P E, E their unit vectors. Supernodes that hold no row of Y but 0 are passed over.
Eigen::MatrixXd CholmodFactor::inverse_between(const std::vector<int>& unknowns) const {
    const cholmod_factor& L = *impl_->L;
    const auto n = static_cast<Eigen::Index>(L.n), count = static_cast<Eigen::Index>(unknowns.size());
    const int *order = static_cast<const int*>(L.Perm), *first_column = static_cast<const int*>(L.super),
              *first_row = static_cast<const int*>(L.pi), *first_value = static_cast<const int*>(L.px),
              *rows = static_cast<const int*>(L.s);
    const auto* values = static_cast<const double*>(L.x);
    std::vector<int> place(static_cast<std::size_t>(n));
    for (int k = 0; k < n; ++k) place[static_cast<std::size_t>(order[k])] = k;
    std::vector<char> reached(static_cast<std::size_t>(n), 0);
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Rows Y = Rows::Zero(n, count);
    for (Eigen::Index c = 0; c < count; ++c) {
        const int row = place[static_cast<std::size_t>(unknowns[static_cast<std::size_t>(c)])];
        Y(row, c) = 1;
        reached[static_cast<std::size_t>(row)] = 1;
    }
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(count, count);
    for (std::size_t s = 0; s < L.nsuper; ++s) {
        const int begin = first_column[s], columns = first_column[s + 1] - begin, *row = rows + first_row[s],
                  height = first_row[s + 1] - first_row[s];
        if (std::find(reached.begin() + begin, reached.begin() + begin + columns, 1) ==
            reached.begin() + begin + columns)
            continue;
        const Eigen::Map<const Eigen::MatrixXd> block(values + first_value[s], height, columns);
        auto here = Y.middleRows(begin, columns);
        block.topRows(columns).triangularView<Eigen::Lower>().solveInPlace(here);
        result.selfadjointView<Eigen::Lower>().rankUpdate(here.transpose());
        const Rows below = block.bottomRows(height - columns) * here;
        for (int r = columns; r < height; ++r) {
            Y.row(row[r]) -= below.row(r - columns);
            reached[static_cast<std::size_t>(row[r])] = 1;
        }
    }
    return result.selfadjointView<Eigen::Lower>();
}

double CholmodFactor::solves_per_factor() const {
    return impl_->solves_per_factor;
}

long long CholmodFactor::nonzeros() const {
    return static_cast<long long>(impl_->L->xsize);
}

}  // namespace tissuewarp::tled::detail
