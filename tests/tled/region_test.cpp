/// Regions against the whole.
#include "tled/region.hpp"
#include "meshing/primitives.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/equilibrium.hpp"

#include "core/errors.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <vector>

namespace tissuewarp::tled {
namespace {

using namespace scene;

enum class Held { FarEnd, Base };

/// A bar of 120 mm along x, held at its far end or on its base, pressed by 2 mm at the near one on a patch of its top.
struct Bar {
    Model model;
    Conditions conditions;
    std::vector<int> targets;

    explicit Bar(Held held = Held::Base) {
        model.mesh = meshing::box_mesh({120, 30, 30}, {24, 6, 6}, 0.1, 2);
        model.materials = {{1, neo_hookean_iso(3, 0.4)}};
        model.element = Element::T4;
        const Matrix3Xd& X = model.mesh.nodes;
        for (int a = 0; a < X.cols(); ++a) {
            if (held == Held::FarEnd ? X(0, a) > 120 - 1e-9 : X(2, a) < 1e-9)
                conditions.prescribed.push_back({a, {true, true, true}, {0, 0, 0}});
            if (X(2, a) > 30 - 1e-9 && X(0, a) < 15)
                conditions.prescribed.push_back({a, {false, false, true}, {0, 0, -2}});
            if (X(0, a) < 25) targets.push_back(a);
        }
        conditions.external_force = Vector3d(0, 0, -2000) * rest_state(model).lumped_mass.transpose();
    }

    [[nodiscard]] std::vector<bool> kept_within(double x) const {
        std::vector<bool> keep;
        for (int t = 0; t < model.mesh.tet_count(); ++t)
            keep.push_back(model.mesh.nodes(0, model.mesh.tets.col(t)).mean() < x);
        return keep;
    }
};

Matrix3Xd settled(const Model& model, const Conditions& conditions) {
    const RestState rest = rest_state(model);
    const NodalConditions nodal = nodal_conditions(conditions, rest);
    const auto engine = make_cpu_engine(rest, Scalar::Float64);
    return equilibrium(*engine, RestStiffness(rest, nodal), nodal, {.tolerance_mm = 1e-4}).displacement;
}

double change_at_targets(const Bar& bar, const Region& region) {
    const Matrix3Xd whole = settled(bar.model, bar.conditions), part = settled(region.model, region.conditions);
    double largest = 0;
    for (std::size_t a = 0; a < region.node_of.size(); ++a)
        if (std::find(bar.targets.begin(), bar.targets.end(), region.node_of[a]) != bar.targets.end())
            largest = std::max(largest, (whole.col(region.node_of[a]) - part.col(static_cast<Eigen::Index>(a))).norm());
    return largest;
}

TEST(Region, OfEverythingIsTheWhole) {
    const Bar bar;
    const Region region = region_of(bar.model, bar.conditions, bar.kept_within(1e9), bar.targets);
    EXPECT_LT(region.estimated_change_mm, 1e-9);
    EXPECT_EQ(region.node_of.size(), static_cast<std::size_t>(bar.model.mesh.node_count()));
    EXPECT_LT(change_at_targets(bar, region), 1e-9);
}

// A failure looks like: an estimate far from what the nonlinear answers show, or tissue that hangs too low because the
// weight of what was left out is lost.
TEST(Region, TheEstimateForetellsTheChange) {
    const Bar bar;
    double before = 1e9;
    for (const double x : {40.0, 50.0, 70.0}) {
        const Region region = region_of(bar.model, bar.conditions, bar.kept_within(x), bar.targets);
        const double change = change_at_targets(bar, region);
        EXPECT_NEAR(region.estimated_change_mm, change, 0.3 * change + 1e-3) << x;
        EXPECT_LT(change, before) << x;
        before = change;
    }
    EXPECT_LT(before, 0.02);
}

// Springs at nodes carry no moment of a far end: the estimate must say so.
TEST(Region, OfACantileverIsFarOffAndKnowsIt) {
    const Bar bar(Held::FarEnd);
    const Region region = region_of(bar.model, bar.conditions, bar.kept_within(60), bar.targets);
    EXPECT_GT(change_at_targets(bar, region), 1.0);
    EXPECT_GT(region.estimated_change_mm, 1.0);
}

TEST(Region, ATranslationMeetsTheRightForce) {
    Bar bar(Held::FarEnd);
    bar.conditions.external_force.setZero();
    bar.conditions.prescribed.clear();
    const Matrix3Xd& X = bar.model.mesh.nodes;
    for (int a = 0; a < X.cols(); ++a) {
        if (X(0, a) > 120 - 1e-9) bar.conditions.prescribed.push_back({a, {true, true, true}, {0, 0, 0}});
        if (X(0, a) < 60 + 1e-9) bar.conditions.prescribed.push_back({a, {true, true, true}, {0.01, 0, 0}});
    }
    // All of the near half moves by 0.01 mm: the force that the far half returns is that of a bar of 60 mm.
    const RestState rest = rest_state(bar.model);
    const NodalConditions nodal = nodal_conditions(bar.conditions, rest);
    const double whole = internal_force(rest, RestStiffness(rest, nodal).linear_solution(nodal))
                             .row(0)
                             .cwiseProduct((X.row(0).array() < 60 + 1e-9).cast<double>().matrix())
                             .sum();
    Conditions held_far;
    for (const PrescribedDisplacement& each : bar.conditions.prescribed)
        if (each.displacement.isZero(0.0)) held_far.prescribed.push_back(each);
    std::vector<bool> keep;
    for (int t = 0; t < bar.model.mesh.tet_count(); ++t)
        keep.push_back(X(0, bar.model.mesh.tets.col(t)).maxCoeff() < 60 + 6);
    const Region region = region_of(bar.model, held_far, keep, {0});
    double springs = 0;
    for (const Spring& spring : region.conditions.springs) springs += 0.01 * spring.stiffness(0, 0);
    EXPECT_NEAR(springs / whole, 60.0 / 57.0, 0.08);  // the interface lies between 60 and 66 mm
}

TEST(Region, NonsenseIsRefusedByName) {
    Bar bar;
    const auto message_of = [&](const std::vector<bool>& keep, const std::vector<int>& targets) -> std::string {
        try {
            region_of(bar.model, bar.conditions, keep, targets);
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "accepted";
    };
    EXPECT_THAT(message_of({true}, {}), ::testing::HasSubstr("marks 1 tetrahedra"));
    EXPECT_THAT(message_of(bar.kept_within(-1), {}), ::testing::HasSubstr("keeps no tetrahedron"));
    EXPECT_THAT(message_of(bar.kept_within(50), {bar.model.mesh.node_count() - 1}), ::testing::HasSubstr("outside"));
    const auto boundary = meshing::boundary_surface(bar.model.mesh);
    Eigen::Matrix3Xi faces = boundary.surface.triangles;
    for (int& node : faces.reshaped()) node = boundary.node_of[static_cast<std::size_t>(node)];
    bar.conditions.effects.pressures.push_back({faces, 1.0});
    EXPECT_THAT(message_of(bar.kept_within(50), {}), ::testing::HasSubstr("keep the tissue there"));
}

}  // namespace
}  // namespace tissuewarp::tled
