/// The nearest place on lines, beside a search of all segments.
#include "meshing/search/curve_tree.hpp"

#include "tests/support/numbers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace tissuewarp::meshing {
namespace {

using Eigen::Vector3d;

using test::Numbers;

/// The simple twin: every segment is looked at.
CurveTree::Hit nearest_of_all(const Eigen::Matrix3Xd& points, const std::vector<Segment>& segments,
                              const Vector3d& query, const TangentGate& gate) {
    CurveTree::Hit best;
    best.distance = 1e30;
    for (std::size_t s = 0; s < segments.size(); ++s) {
        const Vector3d chord = (points.col(segments[s].chord[1]) - points.col(segments[s].chord[0])).normalized();
        if (!gate.tangent.isZero() && std::abs(gate.tangent.dot(chord)) < gate.least_cosine) continue;
        const Vector3d a = points.col(segments[s].ends[0]), b = points.col(segments[s].ends[1]);
        const double along = std::clamp((b - a).dot(query - a) / (b - a).squaredNorm(), 0.0, 1.0);
        const double distance = (a + along * (b - a) - query).norm();
        if (distance < best.distance) best = {int(s), along, a + along * (b - a), chord, distance};
    }
    return best;
}

TEST(CurveTree, AgreesWithLookingAtEverySegment) {
    Numbers numbers(1);
    Eigen::Matrix3Xd points(3, 300);
    std::vector<Segment> segments;
    for (int n = 0; n < 300; ++n) {
        const bool start = n % 60 == 0;
        points.col(n) = start ? Vector3d(40 * numbers.in_cube()) : Vector3d(points.col(n - 1) + 3 * numbers.in_cube());
        if (!start) segments.push_back({{n - 1, n}, {std::max(n - n % 60, n - 3), n}});
    }
    const CurveTree tree(points, segments);
    int gated = 0;
    for (int n = 0; n < 500; ++n) {
        const Vector3d query = 60 * numbers.in_cube();
        const TangentGate gate{n % 3 ? numbers.direction() : Vector3d(0, 0, 0), 0.7};
        const auto expected = nearest_of_all(points, segments, query, gate);
        const auto found = tree.nearest(query, 1e3, gate);
        ASSERT_TRUE(found) << n;
        EXPECT_EQ(found->segment, expected.segment) << n;
        EXPECT_NEAR(found->distance, expected.distance, 1e-9) << n;
        EXPECT_NEAR((found->point - expected.point).norm(), 0, 1e-9) << n;
        EXPECT_NEAR((found->tangent - expected.tangent).norm(), 0, 1e-9) << n;
        gated += expected.distance > nearest_of_all(points, segments, query, {}).distance + 1e-6;
        EXPECT_FALSE(tree.nearest(query, 0.99 * expected.distance, gate)) << n;
    }
    EXPECT_GT(gated, 50);  // the gate decided
}

}  // namespace
}  // namespace tissuewarp::meshing
