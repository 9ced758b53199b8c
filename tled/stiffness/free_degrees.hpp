#pragma once
/// The degrees of freedom 3·node + component that nothing prescribes, numbered in their order.

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

class FreeDegrees {
public:
    FreeDegrees() = default;
    explicit FreeDegrees(const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained);

    [[nodiscard]] int count() const { return count_; }
    /// Of every degree of freedom its free number, or −1.
    [[nodiscard]] const std::vector<int>& index() const { return index_; }
    /// The node of every free one, ascending.
    [[nodiscard]] std::vector<int> nodes() const;

    /// 3 × N → those that are free, and back, zero where not.
    [[nodiscard]] Eigen::VectorXd reduced(const Eigen::Matrix3Xd& x) const;
    [[nodiscard]] Eigen::Matrix3Xd expanded(const Eigen::VectorXd& x) const;

    /// `operation` on the free rows of columns (3N × k); zero elsewhere.
    template <class Operation>
    [[nodiscard]] Eigen::MatrixXd on_free(const Eigen::MatrixXd& columns, const Operation& operation) const {
        Eigen::MatrixXd free(count_, columns.cols()), result = Eigen::MatrixXd::Zero(columns.rows(), columns.cols());
        if (count_ == 0) return result;
        for (std::size_t d = 0; d < index_.size(); ++d)
            if (index_[d] >= 0) free.row(index_[d]) = columns.row(static_cast<Eigen::Index>(d));
        const Eigen::MatrixXd answer = operation(free);
        for (std::size_t d = 0; d < index_.size(); ++d)
            if (index_[d] >= 0) result.row(static_cast<Eigen::Index>(d)) = answer.row(index_[d]);
        return result;
    }

private:
    std::vector<int> index_;
    int count_ = 0;
};

}  // namespace tissuewarp::tled::detail
