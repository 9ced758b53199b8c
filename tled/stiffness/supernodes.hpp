#pragma once
/// Supernodal Cholesky factors over the elimination tree, in all threads. CHOLMOD's analysis tells which columns of L
/// are alike (Chen, Davis, Hager and Rajamanickam, ACM TOMS 35 (2008) 22); its own numbers come in one order, one
/// supernode after the other. Here branches of the tree are factorised beside each other (Heath, Ng and Peyton, SIAM
/// Review 33 (1991) 420), and large supernodes by tiles. Every number is the same sum in the same order, so that
/// results do not depend on the number of threads. Needs a BLAS that takes one thread per call.

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <vector>

namespace tissuewarp::tled::detail {

/// The columns of L that have the same rows. Supernode s has the columns first_column[s] up to first_column[s + 1] and
/// the rows row[first_row[s]] up to row[first_row[s + 1]], ascending, its own columns first. Its values begin at
/// first_value[s], column by column.
struct Supernodes {
    std::vector<int> first_column, first_row, first_value, row;

    [[nodiscard]] int count() const { return static_cast<int>(first_column.size()) - 1; }
    [[nodiscard]] int begin(int s) const { return first_column[static_cast<std::size_t>(s)]; }
    [[nodiscard]] int end(int s) const { return first_column[static_cast<std::size_t>(s) + 1]; }
    [[nodiscard]] int columns(int s) const { return end(s) - begin(s); }
    [[nodiscard]] const int* rows(int s) const { return row.data() + first_row[static_cast<std::size_t>(s)]; }
    [[nodiscard]] int height(int s) const {
        return first_row[static_cast<std::size_t>(s) + 1] - first_row[static_cast<std::size_t>(s)];
    }
    [[nodiscard]] std::size_t values_of(int s) const {
        return static_cast<std::size_t>(first_value[static_cast<std::size_t>(s)]);
    }
};

class SupernodeTree {
public:
    /// Of n unknowns in the order of the analysis, in which children come before their parents and branches follow each
    /// other: unknown `order[k]` of the matrix is its k-th.
    SupernodeTree(Supernodes supernodes, const int* order, int n);

    /// L of the matrix whose lower triangle is given, in the matrix' own order. `values` are L's, overwritten. False
    /// where the matrix is not positive definite.
    [[nodiscard]] bool factorise(const Eigen::SparseMatrix<double>& lower, double* values) const;

    /// A⁻¹ times columns, n × k, matrix' own order.
    [[nodiscard]] Eigen::MatrixXd solve(const double* values, const Eigen::MatrixXd& columns) const;

private:
    /// Rows `begin` to before `end` of an earlier supernode are columns of a later one.
    struct Update {
        int from, begin, end;
    };
    /// Supernodes `first` to `last`, a branch or a part of the stem, after the tasks that `waits_for` counts.
    struct Task {
        int first, last, parent = -1, waits_for = 0;
    };

    void list_updates();
    void make_tasks();
    void scatter(const Eigen::SparseMatrix<double>& lower, double* values) const;
    void solve_lower(const double* values, int s, Eigen::Ref<Eigen::MatrixXd> x) const;
    void solve_upper(const double* values, int s, Eigen::Ref<Eigen::MatrixXd> x) const;
    template <class Visit>
    void leaves_to_roots(const Visit& visit) const;
    template <class Visit>
    void roots_to_leaves(const Visit& visit) const;

    Supernodes supernodes_;
    std::vector<int> place_;                  // of each unknown in the order of the analysis
    std::vector<int> supernode_of_;           // of each column
    std::vector<int> parent_;                 // of each supernode; -1: none
    std::vector<int> first_update_;           // of each supernode, with an end mark
    std::vector<Update> updates_;             // in the order in which they are subtracted
    std::vector<double> work_;                // of each supernode, operations
    std::vector<Task> tasks_;                 // each after those it waits for
    std::vector<std::vector<int>> children_;  // of tasks
};

}  // namespace tissuewarp::tled::detail
