/// The nearest of many points, beside a search of all of them.
#include "meshing/search/point_tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace tissuewarp::meshing {
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
            EXPECT_EQ(tree.nearest(query).index, int(nearest)) << count;
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
        EXPECT_EQ(tree.nearest(query).index, int(nearest_of_all(points, query))) << n;
    }
}

// Whole numbers: many are as near as each other, and many lie at the radius exactly.
TEST(PointTree, SomeAndAllWithinARadiusAreThoseOfAFullSearch) {
    std::mt19937 generator(5);
    std::vector<Vector3d> points;
    const auto drawn = [&](int size) {
        const auto along = [&] { return double(int(generator() % unsigned(size))); };
        return Vector3d(along(), 2 * along(), along());
    };
    for (int n = 0; n < 700; ++n) points.push_back(drawn(12));
    const PointTree tree(points);
    for (const double radius : {0.0, 0.5, 1.0, std::sqrt(2.0), 3.0, 500.0})
        for (int n = 0; n < 500; ++n) {
            const Vector3d query = n % 5 == 0 ? points[static_cast<std::size_t>(n)] : drawn(18);
            const auto distance = [&](const Vector3d& point) { return (point - query).norm(); };
            EXPECT_EQ(tree.any_within(query, radius), std::any_of(points.begin(), points.end(), [&](const auto& point) {
                          return (point - query).squaredNorm() < radius * radius;
                      }));
            EXPECT_EQ(tree.count_within(query, radius),
                      std::count_if(points.begin(), points.end(),
                                    [&](const auto& point) { return distance(point) <= radius; }));
        }
}

TEST(PointTree, TheNearestFewAreThoseOfAFullSearch) {
    std::mt19937 generator(7);
    Eigen::Matrix3Xd points(3, 600);
    for (double& x : points.reshaped()) x = generator() % 9;
    std::vector<int> columns;
    for (int n = 0; n < 600; n += 2) columns.push_back(n);
    const PointTree tree(points, columns);
    for (const std::size_t count : {0, 1, 24, 1000})
        for (int of = 0; of < 100; ++of) {
            std::vector<PointTree::Neighbour> all;
            for (const int n : columns)
                if (n != of) all.push_back({(points.col(n) - points.col(of)).squaredNorm(), n});
            std::sort(all.begin(), all.end());
            all.resize(std::min(all.size(), count));
            EXPECT_EQ(tree.nearest(points.col(of), count, of), all) << count << ' ' << of;
        }
}

TEST(PointTree, WithoutPointsEverythingIsFar) {
    EXPECT_EQ(PointTree(std::vector<Vector3d>{}).distance({1, 2, 3}), std::numeric_limits<double>::infinity());
    EXPECT_FALSE(PointTree(std::vector<Vector3d>{}).any_within({1, 2, 3}, 1e9));
    EXPECT_TRUE(PointTree(std::vector<Vector3d>{}).nearest({1, 2, 3}, 4).empty());
}

}  // namespace
}  // namespace tissuewarp::meshing
