/// Points by cubes against a search through all of them.
#include "registration/search/near_points.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include <algorithm>

namespace tissuewarp::registration::detail {
namespace {

TEST(NearPoints, SayWhatAFullSearchSays) {
    cv::RNG random(5);
    const auto anywhere = [&](double size) {
        return Eigen::Vector3d(random.uniform(0.0, size), random.uniform(0.0, 2 * size), random.uniform(0.0, size));
    };
    for (const double radius : {0.01, 3.0, 500.0}) {
        std::vector<Eigen::Vector3d> points;
        for (int n = 0; n < 300; ++n) points.push_back(anywhere(60));
        const NearPoints near(points, radius);
        for (int n = 0; n < 500; ++n) {
            const Eigen::Vector3d query = n % 5 == 0 ? points[static_cast<std::size_t>(n / 5)] : anywhere(90);
            const bool expected = std::any_of(points.begin(), points.end(), [&](const Eigen::Vector3d& point) {
                return (point - query).norm() < radius;
            });
            EXPECT_EQ(near.any_about(query), expected) << radius << ' ' << query.transpose();
        }
    }
    EXPECT_FALSE(NearPoints({}, 1).any_about(Eigen::Vector3d::Zero()));
}

}  // namespace
}  // namespace tissuewarp::registration::detail
