#include "tled/stiffness/tangent_stiffness.hpp"

#include "tled/stiffness/stiffness.hpp"

#include <numeric>
#include <vector>

namespace tissuewarp::tled {

Eigen::SparseMatrix<double> tangent_stiffness(const RestState& rest, const Eigen::Matrix3Xd& displacement) {
    std::vector<int> all(3 * static_cast<std::size_t>(rest.node_count));
    std::iota(all.begin(), all.end(), 0);
    const detail::Stiffness K = detail::stiffness(rest, displacement);
    return detail::scalar_matrix(detail::assembled(K, detail::Triangle::Full), all, detail::Triangle::Full);
}

}  // namespace tissuewarp::tled
