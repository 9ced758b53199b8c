#include "tled/stiffness/free_degrees.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;

FreeDegrees::FreeDegrees(const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained)
    : index_(static_cast<std::size_t>(constrained.size()), -1) {
    for (int d = 0; d < static_cast<int>(index_.size()); ++d)
        if (!constrained.data()[d]) index_[static_cast<std::size_t>(d)] = count_++;
}

std::vector<int> FreeDegrees::nodes() const {
    std::vector<int> nodes;
    for (std::size_t d = 0; d < index_.size(); ++d)
        if (index_[d] >= 0) nodes.push_back(static_cast<int>(d) / 3);
    return nodes;
}

VectorXd FreeDegrees::reduced(const Matrix3Xd& x) const {
    VectorXd result(count_);
    for (std::size_t d = 0; d < index_.size(); ++d)
        if (index_[d] >= 0) result[index_[d]] = x.data()[d];
    return result;
}

Matrix3Xd FreeDegrees::expanded(const VectorXd& x) const {
    Matrix3Xd result = Matrix3Xd::Zero(3, static_cast<Eigen::Index>(index_.size()) / 3);
    for (std::size_t d = 0; d < index_.size(); ++d)
        if (index_[d] >= 0) result.data()[d] = x[index_[d]];
    return result;
}

}  // namespace tissuewarp::tled::detail
