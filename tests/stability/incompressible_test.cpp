// Volume that is 1 to 5 000 times stiffer than shape.

#include "tests/stability/hard_cases.hpp"

namespace tissuewarp::stability {
namespace {

class Incompressible : public ::testing::TestWithParam<std::tuple<Kind, double>> {
protected:
    Kind kind = std::get<0>(GetParam());
    double poisson = std::get<1>(GetParam());
};
INSTANTIATE_TEST_SUITE_P(All, Incompressible,
                         ::testing::Combine(every_engine, ::testing::Values(0.3, 0.45, 0.49, 0.499, 0.4999)),
                         [](const auto& each) {
                             std::string digits = std::to_string(std::get<1>(each.param)).substr(2, 4);
                             return std::string(name_of(std::get<0>(each.param))) + "Nu0_" + digits;
                         });

// A failure looks like: no convergence within the evaluations, a displacement of millimetres where Newton finds
// another, or a checkerboard of volumes (min J far from 1). Tolerance 0.05 mm of 8 mm.
TEST_P(Incompressible, APushedAndShearedCubeEndsWhereNewtonsMethodDoes) {
    const tled::Model model = box({40, 40, 40}, {6, 6, 6}, tled::neo_hookean_lnj(3.0, poisson));
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {5, 0, -6});
    const Matrix3Xd truth = by_newton(rest, conditions);
    EXPECT_LT(distance(solved(kind, rest, conditions, 0.02), truth), 0.05);
    EXPECT_GT(tled::jacobians(rest, truth).minCoeff(), 0.3);
}

}  // namespace
}  // namespace tissuewarp::stability
