/// Figures as SVG text.
#include "report/figure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tissuewarp::report {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string drawn(FigurePoint from, FigurePoint to) {
    return svg_figure({}, {{.title = "title", .x = {"x"}, .y = {"y"}, .curves = {{"#000000", {}, {}, {from, to}}}}});
}

TEST(Figure, NarrowAxesHaveTicksEnoughToReadThem) {
    EXPECT_THAT(drawn({1.4, 1}, {3.8, 1000}), AllOf(HasSubstr(">1.5<"), HasSubstr(">2<"), HasSubstr(">3<")));
}

TEST(Figure, WideAxesHaveDecadesAlone) {
    EXPECT_THAT(drawn({0.01, 0.01}, {1000, 1000}), AllOf(HasSubstr(">10<"), Not(HasSubstr(">5<"))));
}

}  // namespace
}  // namespace tissuewarp::report
