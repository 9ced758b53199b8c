/// What points say: fronts, knees, lines of equal value, plans and verdicts, on numbers made up for the purpose.
#include "study/fronts.hpp"
#include "study/findings.hpp"
#include "study/plan.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace tissuewarp::study {
namespace {

using testing::ElementsAre;

// A point that another beats in both, or equals in one and beats in the other, is not on it.
TEST(ParetoFront, HoldsWhatNothingBeats) {
    EXPECT_THAT(pareto_front({{3, 1}, {1, 4}, {2, 4}, {2, 2}, {4, 1}, {5, 0.5}}), ElementsAre(1, 3, 0, 5));
    EXPECT_THAT(pareto_front({{1, 1}, {1, 1}}), testing::SizeIs(1));
    EXPECT_THAT(pareto_front({}), ElementsAre());
}

// The slow twin: a point is on the front when no other one is better in one and not worse in the other.
TEST(ParetoFront, AgreesWithTheDefinition) {
    std::vector<Cost> points;
    for (int i = 0; i < 60; ++i) points.push_back({double(i * 37 % 23), double(i * 17 % 29)});
    const auto front = pareto_front(points);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const bool beaten = std::any_of(points.begin(), points.end(), [&](const Cost& other) {
            return other.seconds <= points[i].seconds && other.error_mm <= points[i].error_mm &&
                   (other.seconds < points[i].seconds || other.error_mm < points[i].error_mm);
        });
        const bool on = std::any_of(front.begin(), front.end(), [&](std::size_t f) {
            return points[f].seconds == points[i].seconds && points[f].error_mm == points[i].error_mm;
        });
        EXPECT_EQ(on, !beaten) << points[i].seconds << ", " << points[i].error_mm;
    }
}

TEST(Knee, IsTheQuickestWithinFivePercentOfTheBest) {
    EXPECT_EQ(knee({{1, 2}, {2, 1.049}, {3, 1.03}, {10, 1}}), 1u);
    EXPECT_EQ(knee({{1, 2}, {2, 1.051}, {10, 1}}), 2u);
    EXPECT_EQ(knee({{1, 2}, {2, 1.5}, {10, 1}}, 0.6), 1u);
}

// v = x y has the hyperbola x y = 4 as its line of 4, straight in logarithms: an error of interpolation would bend it.
TEST(LevelLine, FollowsAPowerLawExactly) {
    const std::vector<double> x{1, 2, 8}, y{0.5, 1, 16};
    Eigen::MatrixXd values(3, 3);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) values(i, j) = x[std::size_t(j)] * y[std::size_t(i)];
    const auto segments = level_line(x, y, values, 4);
    ASSERT_FALSE(segments.empty());
    for (const LevelSegment& segment : segments)
        for (const auto& end : segment) EXPECT_NEAR(end.x() * end.y(), 4, 1e-9);
    values(1, 1) = std::nan("");
    EXPECT_TRUE(level_line(x, y, values, 4).empty());
    EXPECT_TRUE(level_line(x, y, values, 1000).empty());
}

TEST(Percentile, IsLinearBetweenNeighbours) {
    EXPECT_EQ(percentile({3, 1, 2}, 0.5), 2);
    EXPECT_EQ(percentile({1, 2, 3, 4}, 0.5), 2.5);
    EXPECT_EQ(percentile({7}, 0.95), 7);
    EXPECT_NEAR(percentile({0, 100}, 0.95), 95, 1e-12);
}

/// Refuses soft holds.
class Dummy final : public Problem {
public:
    [[nodiscard]] std::string name() const override { return "dummy"; }
    [[nodiscard]] std::string story() const override { return "nothing"; }
    [[nodiscard]] Setting base() const override { return {}; }
    [[nodiscard]] bool is_registration() const override { return false; }
    [[nodiscard]] std::string refusal(const Setting& setting) const override {
        return setting.physics.hold == Hold::Soft ? "no" : "";
    }
    Point measure(const Setting&, int, Observer&) override { return {}; }
};

TEST(Plan, HoldsEverySettingOnceAndTheBase) {
    const Dummy problem;
    for (const Extent extent : {Extent::Quick, Extent::Full}) {
        const PlanOptions options{.extent = extent, .most_elements = 100000};
        const auto settings = plan(problem, options);
        const Setting base = base_of(problem, options);
        EXPECT_EQ(std::count(settings.begin(), settings.end(), base), 1);
        for (const Setting& setting : settings) {
            EXPECT_EQ(std::count(settings.begin(), settings.end(), setting), 1) << words_of(setting);
            EXPECT_NE(factor_of(setting, base), "several") << words_of(setting);
            EXPECT_NE(setting.physics.hold, Hold::Soft);
            EXPECT_LE(setting.elements, 100000);
        }
    }
}

// A mesh or a factor that is made twice would double the time of a study.
TEST(Plan, PutsSharedPreparationsSideBySide) {
    const Dummy problem;
    const auto settings = plan(problem, {});
    const auto shared = [](const Setting& a, const Setting& b) {
        return a.elements == b.elements && a.element == b.element && a.physics == b.physics;
    };
    for (std::size_t i = 0; i < settings.size(); ++i)
        for (std::size_t j = i + 1; j < settings.size(); ++j)
            if (shared(settings[i], settings[j])) {
                EXPECT_TRUE(shared(settings[i], settings[j - 1])) << words_of(settings[j]);
            }
}

Point made_up(const Setting& setting, double seconds, double error) {
    Point point;
    point.problem = "cube";
    point.setting = setting;
    point.seconds = {seconds};
    point.numerical = Distance{error, 2 * error};
    point.model = Distance{0, 0};
    return point;
}

TEST(Findings, DoNotTellApartWhatTheReferenceDoesNot) {
    Setting finer, linear;
    finer.elements = 50000;
    linear.physics.law = Law::Linear;
    std::vector<Point> points{made_up({}, 1, 0.10), made_up(finer, 4, 0.05), made_up(linear, 0.01, 0.05)};
    for (Point& point : points) point.reference_mm = 0.06;
    const Findings findings = findings_of({"cube", "", {}, false}, points);
    ASSERT_EQ(findings.comparisons.size(), 2u);
    EXPECT_EQ(findings.comparisons[0].verdict, "the reference does not tell which is more accurate, slower");
    EXPECT_EQ(findings.comparisons[1].verdict, "more accurate, faster: pays");  // laws are compared on one mesh
    for (Point& point : points) point.reference_mm = 0.04;
    EXPECT_EQ(findings_of({"cube", "", {}, false}, points).comparisons[0].verdict, "more accurate, slower");
}

TEST(Findings, SayWhatPays) {
    Setting finer, linear, slow, precise;
    finer.elements = 50000;
    linear.physics.law = Law::Linear;
    slow.solver = Solver::DynamicRelaxation;
    precise.arithmetic = tled::Scalar::Float64;
    Point failed;
    failed.problem = "cube";
    failed.setting = precise;
    failed.failure = "no start";
    const std::vector<Point> points{made_up({}, 1, 0.1), made_up(finer, 4, 0.05), made_up(linear, 0.01, 0.9),
                                    made_up(slow, 2, 0.1), failed};
    const Findings findings = findings_of({"cube", "", {}, false}, points);
    ASSERT_EQ(findings.comparisons.size(), 3u);
    EXPECT_EQ(findings.comparisons[0].verdict, "more accurate, slower");
    EXPECT_EQ(findings.comparisons[1].verdict, "less accurate, faster");
    EXPECT_EQ(findings.comparisons[2].verdict, "as accurate, slower: does not pay");
    EXPECT_EQ(findings.base, &points[0]);
    EXPECT_EQ(findings.best, &points[1]);
    EXPECT_EQ(findings.knee, nullptr);  // finer meshes always help where there are no data
    EXPECT_EQ(findings.front.size(), 3u);
    ASSERT_EQ(findings.failures.size(), 1u);
    EXPECT_TRUE(findings_of({"brain", "", {}, false}, points).solved.empty());
}

TEST(Findings, KneeIsForRegistrations) {
    std::vector<Point> points{made_up({}, 1, 0.1), made_up({}, 4, 0.099)};
    points[1].setting.elements = 50000;
    for (Point& point : points) point.target = TargetErrors{point.numerical->rms, 0, 0, 0, 1};
    EXPECT_EQ(findings_of({"cube", "", {}, true}, points).knee, &points[0]);
}

// A coarse mesh that errs against the error of a wrong law must not look right.
TEST(Point, ErrorsOfModelAndMeshDoNotCancel) {
    Point point = made_up({}, 1, 0.3);
    point.model = Distance{0.4, 0.4};
    EXPECT_NEAR(point.error_mm(), 0.5, 1e-12);
}

}  // namespace
}  // namespace tissuewarp::study
