/// The bodies of the study: the same question on every mesh, and the right answer to it.
#include "study/body.hpp"
#include "study/reference.hpp"

#include "meshing/primitives.hpp"
#include "tests/support/folders.hpp"
#include "tled/reference/quadratic.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>

namespace tissuewarp::study {
namespace {

using Eigen::Vector3d;

/// Springs on a body, added up: stiffness (mN/mm) and stiffness times target.
struct Pulls {
    double stiffness = 0;
    Vector3d force = Vector3d::Zero();
};
Pulls pulls_of(const tled::Conditions& conditions) {
    Pulls sum;
    for (const tled::Spring& spring : conditions.springs) {
        sum.stiffness += spring.stiffness(0, 0);
        sum.force += spring.stiffness * spring.target;
    }
    return sum;
}

// Springs that depend on the number of nodes would be another problem on every mesh: 3 kPa/mm on two faces of 10⁴ mm².
TEST(StretchedCube, IsHeldAlikeOnAllMeshes) {
    const Body cube = stretched_cube();
    for (const int elements : {6, 384, 6000}) {
        const Pulls soft = pulls_of(conditions_of(cube, Hold::Soft, cube.mesh(elements, silent_observer())));
        EXPECT_NEAR(soft.stiffness, 6e4, 1e-6) << elements;
        EXPECT_NEAR(soft.force.z(), 3e4 * 20, 1e-5) << elements;
    }
    const auto mesh = cube.mesh(384, silent_observer());
    const auto hard = conditions_of(cube, Hold::Hard, mesh);
    EXPECT_TRUE(hard.springs.empty());
    EXPECT_EQ(hard.prescribed.size(), 2 * 25u);
    for (const auto& held : hard.prescribed) EXPECT_EQ(held.displacement.z(), mesh.nodes(2, held.node) > 50 ? 20 : 0);
}

// A quarter of one face, with the planes of symmetry besides.
TEST(StretchedCube, PartIsHeldByTheSameSprings) {
    const Body cube = stretched_cube();
    const auto linear = cube.reference_mesh(162, silent_observer());
    const auto conditions = conditions_of(cube, Hold::Soft, linear, tled::quadratic_mesh(linear));
    EXPECT_NEAR(pulls_of(conditions).stiffness, 3e4 / 4, 1e-6);
    EXPECT_FALSE(conditions.prescribed.empty());
}

// Against an independent solution by other software: data/reference/p1_cube_stretch.json, known to 0.001 mm; its ν is
// 0.489997 in place of 0.49.
TEST(StretchedCube, ReferenceAgreesWithAnIndependentSolution) {
    const nlohmann::json file =
        nlohmann::json::parse(std::ifstream(tissuewarp::test::source_folder() / "data/reference/p1_cube_stretch.json"));
    Body cube = stretched_cube();
    const auto& points = file.at("points");
    const auto& truth = file.at("values").at("lnJ").at("u").at("value");
    cube.samples.resize(3, static_cast<Eigen::Index>(points.size()));
    Eigen::Matrix3Xd expected = cube.samples;
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t c = 0; c < 3; ++c) {
            cube.samples(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(i)) =
                1000 * points[i][c].get<double>();
            expected(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(i)) = 1000 * truth[i][c].get<double>();
        }
    const Reference reference = reference_of(cube, {}, 750, silent_observer());
    const double off = (reference.displacement - expected).colwise().norm().maxCoeff();
    EXPECT_LT(off, 0.02);  // mm, of 20
    EXPECT_LT(off, 2 * reference.largest_uncertainty_mm);
}

// Linear elasticity: twice the load, twice the answer; and far from the nonlinear one.
TEST(Reference, LinearLawIsTheLimitOfSmallLoads) {
    Body cube = stretched_cube();
    const Reference whole = reference_of(cube, {.law = Law::Linear}, 162, silent_observer());
    const auto pull = cube.pull;
    cube.pull = [pull](const Vector3d& X) {
        Pull half = pull(X);
        half.displacement *= 0.5;
        return half;
    };
    cube.symmetry->displacement *= 0.5;
    const Reference half = reference_of(cube, {.law = Law::Linear}, 162, silent_observer());
    EXPECT_LT((whole.displacement - 2 * half.displacement).cwiseAbs().maxCoeff(), 2e-3);
    cube = stretched_cube();
    const Reference nonlinear = reference_of(cube, {}, 162, silent_observer());
    EXPECT_GT((whole.displacement - nonlinear.displacement).cwiseAbs().maxCoeff(), 0.1);
}

}  // namespace
}  // namespace tissuewarp::study
