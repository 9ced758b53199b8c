/// The nearest of many points, beside a search of all of them.
#include "registration/search/point_tree.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tissuewarp::registration::detail {
namespace {

using Eigen::Vector3d;

std::size_t nearest_of_all(const std::vector<Vector3d>& points, const Vector3d& query) {
    std::size_t best = 0;
    for (std::size_t n = 1; n < points.size(); ++n)
        if ((points[n] - query).squaredNorm() < (points[best] - query).squaredNorm()) best = n;
    return best;
}

TEST(PointTree, FindsTheNearestOfScatteredPoints) {
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> place(-50, 50);
    const auto drawn = [&] { return Vector3d(place(generator), place(generator), 0.1 * place(generator)); };
    for (const int count : {1, 2, 9, 500}) {
        std::vector<Vector3d> points;
        for (int n = 0; n < count; ++n) points.push_back(drawn());
        const PointTree tree(points);
        for (int n = 0; n < 200; ++n) {
            const Vector3d query = 1.5 * drawn();
            const std::size_t nearest = nearest_of_all(points, query);
            EXPECT_EQ(tree.nearest(query).index, nearest) << count;
            EXPECT_DOUBLE_EQ(tree.distance(query), (points[nearest] - query).norm());
        }
    }
}

// On a lattice many are as near as each other.
TEST(PointTree, OfPointsAsNearTheFirstIsTaken) {
    std::vector<Vector3d> points;
    for (int n = 0; n < 2 * 216; ++n) points.emplace_back(n % 6, n / 6 % 6, n / 36 % 6);
    const PointTree tree(points);
    for (int n = 0; n < 125; ++n) {
        const Vector3d query(n % 5 + 0.5, n / 5 % 5 + 0.5, n / 25 + 0.5);
        EXPECT_EQ(tree.nearest(query).index, nearest_of_all(points, query)) << n;
    }
}

TEST(PointTree, WithoutPointsEverythingIsFar) {
    EXPECT_EQ(PointTree({}).distance({1, 2, 3}), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace tissuewarp::registration::detail
