#include "meshing/search/point_tree.hpp"
#include "registration/matching/consistency/local_affine.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>

namespace tissuewarp::registration::detail {

std::vector<std::vector<int>> nearest_neighbours(const Eigen::Matrix3Xd& points, const std::vector<int>& of,
                                                 const std::vector<int>& among, int count) {
    const meshing::PointTree tree(points, among);
    std::vector<std::vector<int>> result(of.size());
    tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t n) {
        for (const auto& other : tree.nearest(points.col(of[n]), static_cast<std::size_t>(std::max(count, 0)), of[n]))
            result[n].push_back(other.index);
    });
    return result;
}

std::vector<std::vector<int>> nearest_neighbours(const Eigen::Matrix3Xd& points, int count) {
    std::vector<int> all(static_cast<std::size_t>(points.cols()));
    std::iota(all.begin(), all.end(), 0);
    return nearest_neighbours(points, all, all, count);
}

}  // namespace tissuewarp::registration::detail
