/// The parts of a random phantom, each against something simpler.
#include "study/detail/phantom_data.hpp"
#include "study/detail/quadratic_map.hpp"
#include "study/detail/random.hpp"
#include "study/detail/truth.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <cstdlib>

namespace tissuewarp::study::detail {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// A homogeneous deformation, which isoparametric elements hold exactly.
struct Affine {
    Eigen::Matrix3d F = (Eigen::Matrix3d() << 1.05, 0.08, 0, -0.03, 0.93, 0.05, 0.02, 0, 1.02).finished();
    Vector3d shift{3, -2, 4};

    Vector3d operator()(const Vector3d& X) const { return F * X + shift; }
    [[nodiscard]] Vector3d back(const Vector3d& x) const { return F.inverse() * (x - shift); }
};

struct AffineOrgan {
    Random random{3};
    OrganShape shape{random};
    Affine affine;
    TruthMesh mesh = truth_mesh(shape, 1500);
    Matrix3Xd deformed = (affine.F * mesh.quadratic.nodes).colwise() + affine.shift;
};

TEST(PhantomParts, RandomNumbersHaveTheirMoments) {
    Random random(7);
    constexpr int count = 100000;
    double uniform = 0, mean = 0, square = 0, fourth = 0;
    Eigen::Matrix3d directions = Eigen::Matrix3d::Zero();
    for (int k = 0; k < count; ++k) {
        uniform += random.uniform() / count;
        const double x = random.normal();
        mean += x / count;
        square += x * x / count;
        fourth += x * x * x * x / count;
        const Vector3d d = random.direction();
        directions += d * d.transpose() / count;
    }
    EXPECT_NEAR(uniform, 0.5, 0.005);
    EXPECT_NEAR(mean, 0, 0.015);
    EXPECT_NEAR(square, 1, 0.025);
    EXPECT_NEAR(fourth, 3, 0.2);
    EXPECT_LT((directions - Eigen::Matrix3d::Identity() / 3).norm(), 0.02);
}

TEST(PhantomParts, TheMapOfCurvedElementsHoldsHomogeneousStrain) {
    AffineOrgan organ;
    const QuadraticMap map(organ.mesh.quadratic, organ.deformed - organ.mesh.quadratic.nodes);
    int inside = 0;
    for (int k = 0; k < 2000; ++k) {
        const Vector3d X =
            organ.shape.centre() + 0.5 * organ.shape.length() * organ.random.uniform() * organ.random.direction();
        const auto x = map(X);
        EXPECT_TRUE(x.has_value() || organ.shape.outer_distance(X) > -0.3) << "depth " << organ.shape.outer_distance(X);
        if (!x) continue;
        ++inside;
        EXPECT_LT((*x - organ.affine(X)).norm(), 1e-8);
    }
    EXPECT_GT(inside, 500);
}

/// Voxels of either map's organ that are not of both, mm³, and how far from the true boundary the deepest is.
struct Disagreement {
    double mm3 = 0, deepest_mm = 0;
};
Disagreement disagreement(const imaging::Volume& drawn, const AffineOrgan& organ) {
    Disagreement result;
    const auto* voxel = drawn.data<std::int32_t>();
    for (int k = 0; k < drawn.geometry.size[2]; ++k)
        for (int j = 0; j < drawn.geometry.size[1]; ++j)
            for (int i = 0; i < drawn.geometry.size[0]; ++i) {
                const Vector3d X = organ.affine.back(drawn.geometry.point({double(i), double(j), double(k)}));
                if ((*voxel++ > 0) == (organ.shape.label(X) > 0)) continue;
                result.mm3 += drawn.geometry.voxel_volume();
                result.deepest_mm = std::max(result.deepest_mm, std::abs(organ.shape.outer_distance(X)));
            }
    return result;
}

double surface_area(const AffineOrgan& organ) {
    double area = 0;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(organ.mesh.corners)) {
        if (face.outer != 0) continue;
        const auto& [a, b, c] = face.nodes;
        const Vector3d x = organ.deformed.col(a);
        area += 0.5 * (organ.deformed.col(b) - x).cross(organ.deformed.col(c) - x).norm();
    }
    return area;
}

// The implicit shape, carried back analytically, and the elements that were drawn know nothing of each other.
TEST(PhantomParts, DrawnLabelsAreThoseOfTheShape) {
    AffineOrgan organ;
    Random random(4);
    const auto off = disagreement(drawn_labels({organ.mesh, organ.deformed}, 2, 0, random), organ);
    EXPECT_LT(off.deepest_mm, 0.6);
    EXPECT_LT(off.mm3 / surface_area(organ), 0.06);  // mm, mean distance between both surfaces
}

// E|d| = σ √(2/π) of a boundary shifted by Gaussian noise; noise of another size, or none, is seen at once.
TEST(PhantomParts, BoundaryNoiseHasItsSize) {
    AffineOrgan organ;
    Random random(4);
    const auto off = disagreement(drawn_labels({organ.mesh, organ.deformed}, 2, 0.8, random), organ);
    EXPECT_NEAR(off.mm3 / surface_area(organ), 0.8 * std::sqrt(2 / EIGEN_PI), 0.15);
}

TEST(PhantomParts, SeenPointsAreAShareOfTheSurfaceWithNoise) {
    AffineOrgan organ;
    Random random(4);
    constexpr double deviation = 0.7;
    const DeformedOrgan deformed{organ.mesh, organ.deformed};
    const auto seen = seen_surface(deformed, 0.4, deviation, random);
    EXPECT_NEAR(double(seen.points.cols()), 0.4 * surface_area(organ) / 6, 0.02 * surface_area(organ) / 6);
    std::vector<double> distances;
    for (const auto& point : seen.points.colwise())
        distances.push_back(std::abs(organ.shape.outer_distance(organ.affine.back(point))));
    std::sort(distances.begin(), distances.end());
    const double median = distances[distances.size() / 2], far = distances[distances.size() * 99 / 100];
    EXPECT_NEAR(median, 0.6745 * deviation, 0.1);  // strain of the affine map aside
    EXPECT_GT(far, 4 * deviation) << "no outliers";
}

TEST(PhantomParts, LoadsBringTheMotionThatIsWanted) {
    Random random(11);
    RandomOrgan organ = random_organ(random);
    TruthMesh mesh = truth_mesh(organ.shape, 800);
    organ.loads = sized_loads(organ, mesh, 5);
    const Truth truth = equilibrium(organ, std::move(mesh));
    const double largest = truth.displacement.colwise().norm().maxCoeff();
    EXPECT_GT(largest, 3);
    EXPECT_LT(largest, 8);
    EXPECT_GT(truth.min_jacobian, 0.3);
}

// The truth's own error: the same organ under the same loads on a mesh of four times as many elements.
TEST(PhantomParts, TheTruthIsConverged) {
    Random random(21);
    RandomOrgan organ = random_organ(random);
    TruthMesh mesh = truth_mesh(organ.shape, 2500);
    organ.loads = sized_loads(organ, mesh, 8);
    const Truth truth = equilibrium(organ, std::move(mesh));
    const Truth finer = equilibrium(organ, truth_mesh(organ.shape, 10000));
    const QuadraticMap map(truth.mesh.quadratic, truth.displacement),
        finer_map(finer.mesh.quadratic, finer.displacement);
    double squared = 0, moved = 0;
    int count = 0;
    for (int k = 0; k < 1000; ++k) {
        const Vector3d X = organ.shape.centre() + 0.5 * organ.shape.length() * random.uniform() * random.direction();
        const auto x = map(X), finer_x = finer_map(X);
        if (!x || !finer_x) continue;
        ++count;
        squared += (*x - *finer_x).squaredNorm();
        moved += (*x - X).squaredNorm();
    }
    ASSERT_GT(count, 200);
    RecordProperty("rms_um", int(1000 * std::sqrt(squared / count)));
    EXPECT_GT(std::sqrt(moved / count), 1);
    EXPECT_LT(std::sqrt(squared / count), 0.05);
}

}  // namespace
}  // namespace tissuewarp::study::detail
