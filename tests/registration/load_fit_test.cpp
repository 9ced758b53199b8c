/// Loads found by what data show of them.
#include "registration/field.hpp"
#include "registration/loads/load_finder.hpp"
#include "registration/loads/loaded_posterior.hpp"
#include "registration/loads/smooth_field.hpp"
#include "registration/loads/unknown_bends.hpp"
#include "registration/loads/unknown_loads.hpp"
#include "registration/pose/rigid_part.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/update.hpp"
#include "registration/warp.hpp"
#include "tests/support/label_shapes.hpp"

#include <gmock/gmock.h>
#include <Eigen/Cholesky>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

PreparedModel organ(double edge_length) {
    PrepareOptions options;
    options.meshing.edge_length = edge_length;
    return prepare(shapes::organ_labels({}), options);
}

UpdateOptions with_shapes(int count) {
    UpdateOptions options;
    options.device = Device::Cpu;
    options.tissue.load_shapes = count;
    return options;
}

detail::WeighedSprings prior(const PreparedModel& prepared, double energy) {
    const auto ground = detail::ground_springs(prepared, energy, [](const InterfaceNode&) { return 20.0; });
    return {{}, ground, energy, ground};
}

/// A smooth bend of the free organ, 4 mm in root mean square: of a draw that no fit knows.
Matrix3Xd bent(const PreparedModel& prepared, std::uint64_t seed = 1) {
    const MatrixXd u =
        detail::Posterior(prepared, prior(prepared, 1)).inverse(detail::unknown_bends(prepared, 1, seed));
    const Matrix3Xd field = Eigen::Map<const Matrix3Xd>(u.data(), 3, u.size() / 3);
    return 4 / std::sqrt(field.colwise().squaredNorm().mean()) * field;
}

/// Pairs all over the left two fifths of the organ, which is 100 mm long.
PointPairs left_of_the_middle(const PreparedModel& prepared, const Matrix3Xd& displacement) {
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    std::vector<Eigen::Index> chosen;
    for (Eigen::Index n = 0; n < nodes.cols(); n += 1 + nodes.cols() / 400)
        if (nodes(0, n) < -8) chosen.push_back(n);
    return {nodes(Eigen::all, chosen), nodes(Eigen::all, chosen) + displacement(Eigen::all, chosen), 0.5};
}

/// Mean error at nodes right of the middle, mm.
double error_on_the_right(const PreparedModel& prepared, const UpdateResult& result, const Matrix3Xd& truth) {
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Matrix3Xd found = PointTransform(result.deformation)(nodes);
    double sum = 0;
    int count = 0;
    for (Eigen::Index n = 0; n < nodes.cols(); ++n) {
        if (nodes(0, n) < 12) continue;
        sum += (found.col(n) - nodes.col(n) - truth.col(n)).norm();
        ++count;
    }
    return sum / count;
}

// The simple twin: the mean of u given the data, by its covariance ε K⁻¹ + s² K⁻¹ B Bᵀ K⁻¹ between the nodes that
// springs of stiffness k hold, whose noise has the covariance ε k⁻¹.
TEST(LoadFit, IsTheMeanUnderThePriorOfSmoothLoads) {
    const PreparedModel prepared = organ(12);
    const double energy = 60, stiffness = 40, size = 3;
    detail::WeighedSprings unseen = prior(prepared, energy);
    unseen.placed_by.clear();
    detail::WeighedSprings seen = unseen;
    const Matrix3Xd truth = bent(prepared);
    std::vector<int> held;
    for (int node = 2; node < prepared.rest.node_count; node += 9) held.push_back(node);
    const Eigen::Index rows = 3 * Eigen::Index{prepared.rest.node_count};
    VectorXd pulls = VectorXd::Zero(rows), targets(3 * held.size());
    MatrixXd units = MatrixXd::Zero(rows, targets.size());
    for (std::size_t k = 0; k < held.size(); ++k) {
        const Vector3d target = 5 * truth.col(held[k]);
        seen.data.push_back({held[k], stiffness * Eigen::Matrix3d::Identity(), target});
        pulls.segment<3>(3 * held[k]) = stiffness * target;
        targets.segment<3>(3 * Eigen::Index(k)) = target;
        units.block<3, 3>(3 * held[k], 3 * Eigen::Index(k)).setIdentity();
    }
    const detail::Posterior with(prepared, seen), without(prepared, unseen);
    const detail::LoadShapes shapes(detail::principal_bends(prepared, 8).loads, without, energy);
    const detail::LoadFit fit(shapes, with);
    const VectorXd shown = with.inverse(pulls), found = shown + fit.answers(fit.coefficients(fit.work(shown), size));
    const VectorXd acting = fit.coefficients(fit.work(shown), 0.3 * size), both = shown + fit.answers(acting);
    EXPECT_LT((fit.work_without(acting, fit.work(both)) - fit.work(shown)).norm(), 1e-9 * fit.work(shown).norm());

    const MatrixXd answers = without.inverse(units),
                   loads = shapes.scale() * detail::principal_bends(prepared, 8).loads;
    const MatrixXd covariance =
        energy * answers + size * size * without.inverse(loads) * (loads.transpose() * answers);  // with the held nodes
    const MatrixXd between =
        units.transpose() * covariance + energy / stiffness * MatrixXd::Identity(targets.size(), targets.size());
    const VectorXd expected = covariance * between.ldlt().solve(targets);
    EXPECT_LT((found - expected).norm(), 1e-6 * expected.norm());
    EXPECT_GT((shown - expected).norm(), 0.02 * expected.norm());  // loads matter here

    const detail::LoadedPosterior loaded(detail::Posterior(prepared, seen),
                                         std::make_shared<const detail::KnownLoads>(shapes, size));
    EXPECT_LT((loaded.inverse(pulls) - expected).norm(), 1e-6 * expected.norm());
    const MatrixXd from_all = units.transpose() * loaded.inverse(units);
    EXPECT_LT((loaded.inverse_between(held) - from_all).norm(), 1e-6 * from_all.norm());
    EXPECT_EQ(detail::LoadedPosterior(detail::Posterior(prepared, seen)).inverse(pulls), shown);

    // And the likeliest size is that of the largest density of the targets, of those that are tried.
    const auto density = [&](double s) {
        const MatrixXd c =
            units.transpose() * (energy * answers + s * s * without.inverse(loads) * (loads.transpose() * answers)) +
            energy / stiffness * MatrixXd::Identity(targets.size(), targets.size());
        const Eigen::LLT<MatrixXd> root(c);
        return -0.5 * targets.dot(root.solve(targets)) - root.matrixLLT().diagonal().array().log().sum();
    };
    const double likeliest = fit.likeliest_size(fit.work(shown));
    EXPECT_GT(density(likeliest), density(likeliest * std::sqrt(2.0)));
    EXPECT_GT(density(likeliest), density(likeliest / std::sqrt(2.0)));
    EXPECT_EQ(fit.likeliest_size(fit.work(shown), {likeliest / 8, 1e-3}), likeliest / 8);  // certain beforehand
    EXPECT_EQ(fit.likeliest_size(fit.work(shown), {likeliest / 8, 1e3}), likeliest);       // as good as unknown
    const double between_both = fit.likeliest_size(fit.work(shown), {likeliest / 8, 0.5});
    EXPECT_LE(between_both, likeliest);
    EXPECT_GT(between_both, likeliest / 8);
}

TEST(UnknownBends, ConserveVolumeAndAreAsLargeAsExpected) {
    std::mt19937_64 generator(5);
    const detail::SolenoidalField field(20, 20, generator);
    double divergence = 0, gradient = 0, squares = 0;
    constexpr double h = 1e-3;
    for (int n = 0; n < 500; ++n) {
        const Vector3d x(std::fmod(7.3 * n, 90), std::fmod(11.9 * n, 110), std::fmod(3.1 * n, 70));
        Eigen::Matrix3d slope;
        for (int axis = 0; axis < 3; ++axis)
            slope.col(axis) = (field(x + h * Vector3d::Unit(axis)) - field(x - h * Vector3d::Unit(axis))) / (2 * h);
        divergence += std::abs(slope.trace());
        gradient += slope.norm();
        squares += field(x).squaredNorm() / 500;
    }
    EXPECT_LT(divergence, 1e-6 * gradient);
    EXPECT_NEAR(squares, 2, 1);  // of three components of variance 1 one is lost

    const PreparedModel prepared = organ(12);
    const detail::Posterior unseen(prepared, prior(prepared, 60));
    const detail::LoadShapes shapes(detail::principal_bends(prepared, 48).loads, unseen, 60);
    const double size = detail::expected_bend_mm(prepared) / shapes.deviation_mm();
    const MatrixXd bends = size * shapes.scale() * unseen.inverse(detail::principal_bends(prepared, 48).loads);
    EXPECT_NEAR(std::sqrt(bends.squaredNorm() / prepared.rest.node_count),
                0.08 * detail::radius_of(prepared.model.mesh.nodes), 1e-6);
}

TEST(LoadFit, LoadsOfSizeOneHaveTheStrainEnergyOfOneDeviation) {
    const PreparedModel prepared = organ(12);
    const double energy = 60;
    const detail::Posterior unseen(prepared, prior(prepared, energy));
    const MatrixXd drawn = detail::principal_bends(prepared, 16).loads;
    const MatrixXd loads = detail::LoadShapes(drawn, unseen, energy).scale() * drawn;
    EXPECT_NEAR(0.5 * loads.cwiseProduct(unseen.inverse(loads)).sum() / energy, 1, 1e-9);
}

// A fifth as many shapes are most of all: they are the principal ones.
TEST(PrincipalBends, AreMostOfTheVariance) {
    const PreparedModel prepared = organ(12);
    const double all = detail::principal_bends(prepared, 128).loads.squaredNorm();
    EXPECT_NEAR(detail::unknown_bends(prepared, 128, 7).squaredNorm() / 128 / all, 1, 0.1);
    EXPECT_GT(detail::principal_bends(prepared, 48).loads.squaredNorm(), 0.8 * all);
}

/// What each of the loads does to smooth fields of displacement that no mesh knows, one column per load.
MatrixXd works(const PreparedModel& prepared, const MatrixXd& loads) {
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    MatrixXd result(60, loads.cols());
    for (int wave = 0; wave < 20; ++wave) {
        const Vector3d direction(std::sin(wave), std::cos(1.7 * wave), std::sin(2.3 * wave + 1));
        const VectorXd phases = nodes.transpose() * direction / 15;  // rad, over 15 mm
        for (Eigen::Index k = 0; k < loads.cols(); ++k) {
            const Eigen::Map<const Matrix3Xd> forces(loads.col(k).data(), 3, nodes.cols());
            result.block<3, 1>(3 * wave, k) = forces * (phases.array() + wave).cos().matrix();
        }
    }
    return result;
}

// What is fitted on a coarse mesh acts on a fine one: shape by shape it must be the same.
TEST(PrincipalBends, AreTheSameOnAnotherMesh) {
    const PreparedModel coarse = organ(12), fine = organ(6.5);
    const detail::PrincipalBends found = detail::principal_bends(coarse, 48);
    EXPECT_EQ(detail::bends_along(coarse, found.axes), found.loads);
    const MatrixXd here = works(coarse, found.loads), there = works(fine, detail::bends_along(fine, found.axes));
    for (Eigen::Index k = 0; k < 48; ++k)
        EXPECT_GT(here.col(k).dot(there.col(k)) / here.col(k).norm() / there.col(k).norm(), 0.95) << k;
}

// Tissue that no pair shows goes where the bends put it that move what pairs show; strain energy alone lets it go. In
// the mean of some: a bend of the rest may be any.
TEST(UnknownLoads, MoveWhatNoPairShows) {
    const PreparedModel prepared = organ(10);
    double before = 0, after = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        const Matrix3Xd truth = bent(prepared, seed);
        const PointPairs pairs = left_of_the_middle(prepared, truth);
        const UpdateResult without = update(prepared, {.points = pairs}, with_shapes(0)),
                           with = update(prepared, {.points = pairs}, with_shapes(48));
        EXPECT_EQ(without.pulls.load_size, 0);
        EXPECT_GT(with.pulls.load_size, 7.9);
        before += error_on_the_right(prepared, without, truth);
        after += error_on_the_right(prepared, with, truth);
        EXPECT_GT(with.min_jacobian, 0.8);
    }
    EXPECT_LT(after, 0.75 * before) << before / 6 << " mm without";
}

/// A map of the organ after a deformation.
imaging::Volume labels_after(const PreparedModel& prepared, const Matrix3Xd& displacement) {
    const Deformation deformation{prepared.model.mesh, displacement, Eigen::Isometry3d::Identity()};
    return warp_labels(prepared.labels, displacement_fixed_to_moving(deformation, prepared.labels.geometry));
}

double error_at_nodes(const UpdateResult& result, const PreparedModel& prepared, const Matrix3Xd& truth) {
    const Matrix3Xd found = PointTransform(result.deformation)(prepared.model.mesh.nodes);
    return (found - prepared.model.mesh.nodes - truth).colwise().norm().mean();
}

/// What weight along x does to the organ, 4 mm in root mean square.
Matrix3Xd sagged(const PreparedModel& prepared) {
    const MatrixXd u = detail::Posterior(prepared, prior(prepared, 1)).inverse(detail::unknown_weights(prepared));
    const Matrix3Xd field = Eigen::Map<const Matrix3Xd>(u.data(), 3, u.rows() / 3);
    return 4 / std::sqrt(field.colwise().squaredNorm().mean()) * field;
}

TEST(UnknownWeights, AreInEquilibriumAndAlike) {
    const PreparedModel prepared = organ(12);
    const MatrixXd weights = detail::unknown_weights(prepared);
    ASSERT_EQ(weights.cols(), 3);
    const MatrixXd motions = detail::rigid_motions(prepared.model.mesh.nodes);
    EXPECT_LT((motions.transpose() * weights).norm(), 1e-9 * weights.norm() * motions.norm());
    const MatrixXd drawn = detail::unknown_loads(prepared, 4, 3);
    EXPECT_LT((weights.colwise().norm().maxCoeff()) / drawn.colwise().norm().mean(), 0.23);
}

// A boundary all over shows weight by how the surface bulges; without, tissue within slides back along it.
TEST(UnknownWeights, MoveWhatLabelsDoNotShow) {
    const PreparedModel prepared = organ(10);
    const Matrix3Xd truth = sagged(prepared);
    const imaging::Volume labels = labels_after(prepared, truth);
    UpdateOptions options = with_shapes(0);
    options.align = false;
    const UpdateResult without = update(prepared, {.labels = labels}, options);
    options.tissue.load_shapes = 48;
    const UpdateResult with = update(prepared, {.labels = labels}, options);
    EXPECT_EQ(without.pulls.load_size, 0);
    EXPECT_GT(with.pulls.load_size, 7.9);
    EXPECT_TRUE(with.pulls.of(Origin::Prior).empty());  // of the fit alone
    const double before = error_at_nodes(without, prepared, truth), after = error_at_nodes(with, prepared, truth);
    EXPECT_LT(after, 0.32 * before) << before << " mm without";
    EXPECT_GT(with.min_jacobian, 0.93);
}

// An organ that did not move has none.
TEST(UnknownWeights, OfAnOrganThatLiesStillAreNothing) {
    const PreparedModel prepared = organ(10);
    const UpdateResult result = update(prepared, {.labels = prepared.labels}, with_shapes(48));
    EXPECT_LT(result.deformation.displacement.colwise().norm().maxCoeff(), 1e-3);
    EXPECT_LT(result.pulls.load_size, 0.2);
}

/// What weight does to the organ whose left two fifths are held.
Matrix3Xd hanging(const PreparedModel& prepared, const Vector3d& body_force) {
    tled::Conditions conditions;
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    for (int n = 0; n < nodes.cols(); ++n)
        if (nodes(0, n) < -8) conditions.prescribed.push_back({n});
    conditions.external_force = body_force * (prepared.rest.lumped_mass / prepared.model.density).transpose();
    const auto nodal = tled::nodal_conditions(conditions, prepared.rest.node_count);
    const auto engine = tled::make_cpu_engine(prepared.rest, tled::Scalar::Float64);
    return tled::equilibrium(*engine, tled::RestStiffness(prepared.rest, nodal), nodal, {}).displacement;
}

TEST(StatedLoads, MoveWhatNoPairShows) {
    const PreparedModel prepared = organ(10);
    UpdateOptions options = with_shapes(0);
    options.align = false;
    const Vector3d body_force(0, -2e-4, -5e-4);  // mN/mm³
    const Matrix3Xd truth = hanging(prepared, body_force);
    const PointPairs pairs = left_of_the_middle(prepared, truth);
    const double untold = error_on_the_right(prepared, update(prepared, {.points = pairs}, options), truth);
    options.loads.body_force = body_force;
    const double told = error_on_the_right(prepared, update(prepared, {.points = pairs}, options), truth);
    EXPECT_LT(told, 0.68 * untold);  // 0.62: the prior of a held organ resists the load as well
}

// Around an organ that is held, hold and loads are one.
TEST(UnknownLoads, AreNotLookedForWhereTheOrganIsHeld) {
    const PreparedModel prepared = organ(12);
    UpdateOptions options = with_shapes(48);
    options.align = false;
    const UpdateResult result = update(prepared, {.points = left_of_the_middle(prepared, bent(prepared))}, options);
    EXPECT_EQ(result.pulls.load_size, 0);
}

// An updater keeps shapes, not what an earlier update found.
TEST(UnknownLoads, DoNotDependOnTheUpdateBefore) {
    const auto model = std::make_shared<const PreparedModel>(organ(12));
    const PreparedModel& prepared = *model;
    const Matrix3Xd truth = bent(prepared);
    const PointPairs pairs = left_of_the_middle(prepared, truth), others = left_of_the_middle(prepared, -truth);
    Updater fresh(model, with_shapes(48)), used(model, with_shapes(48));
    static_cast<void>(used.update({.points = others}));
    EXPECT_EQ(fresh.update({.points = pairs}).deformation.displacement,
              used.update({.points = pairs}).deformation.displacement);
}

/// The names of stages, as they come.
struct Stages : Observer {
    std::vector<std::string> names;
    void progress(std::string_view stage, double) override { names.emplace_back(stage); }
};

// Found on a coarser mesh of the organ, they do the same; and where that one was made beforehand, exactly the same.
TEST(UnknownLoads, OfALargeModelAreThoseOfASmallOne) {
    const PreparedModel small = organ(6.5);
    PreparedModel large = organ(3.6);
    ASSERT_GT(large.rest.node_count, 6000);
    ASSERT_LT(small.rest.node_count, 6000);
    const Matrix3Xd truth = bent(large, 4);
    const PointPairs pairs = left_of_the_middle(large, truth);
    const UpdateResult of_large = update(large, {.points = pairs}, with_shapes(48)),
                       of_small = update(small, {.points = pairs}, with_shapes(48)),
                       without = update(large, {.points = pairs}, with_shapes(0));
    EXPECT_NEAR(std::log2(of_large.pulls.load_size / of_small.pulls.load_size), 0, 1);
    EXPECT_LT(error_on_the_right(large, of_large, truth), 0.75 * error_on_the_right(large, without, truth));

    prepare_loads(large);
    ASSERT_TRUE(large.coarse);
    EXPECT_EQ(large.times.back().stage, "coarse model");
    Stages stages;
    const UpdateResult of_prepared = update(large, {.points = pairs}, with_shapes(48), stages);
    EXPECT_EQ(of_prepared.deformation.displacement, of_large.deformation.displacement);
    EXPECT_THAT(stages.names, ::testing::Not(::testing::Contains("relaxing the mesh")));

    const tled::MaterialTable softer{{1, tled::neo_hookean_lnj(2, 0.4)}, {2, tled::neo_hookean_lnj(5, 0.3)}};
    large = with_materials(std::move(large), softer);
    EXPECT_EQ(large.coarse->model.materials, softer);
}

TEST(UnknownLoads, TakeACoarserModelOfALargeFreeOneAlone) {
    PreparedModel small = organ(12);
    prepare_loads(small);
    EXPECT_FALSE(small.coarse);
    PrepareOptions held;
    held.meshing.edge_length = 3.6;
    held.anchors = {2};
    PreparedModel large = prepare(shapes::organ_labels({}), held);
    ASSERT_GT(large.rest.node_count, 6000);
    prepare_loads(large);
    EXPECT_FALSE(large.coarse);
}

// Both meshes at the same time are those of one after the other, whatever the edges promised.
TEST(UnknownLoads, PreparedInOneGoHaveTheSameModels) {
    for (const double edge_mm : {3.6, 6.5}) {
        PrepareOptions options;
        options.meshing.edge_length = edge_mm;
        const imaging::Volume labels = shapes::organ_labels({});
        PreparedModel in_turn = prepare(labels, options);
        prepare_loads(in_turn);
        const PreparedModel at_once = prepare_for_loads(labels, options);
        EXPECT_EQ(at_once.model.mesh.nodes, in_turn.model.mesh.nodes);
        EXPECT_EQ(at_once.model.mesh.tets, in_turn.model.mesh.tets);
        ASSERT_EQ(at_once.coarse != nullptr, in_turn.coarse != nullptr) << edge_mm;
        EXPECT_EQ(at_once.coarse != nullptr, edge_mm < 5);
        if (!at_once.coarse) continue;
        EXPECT_EQ(at_once.coarse->model.mesh.nodes, in_turn.coarse->model.mesh.nodes);
        EXPECT_EQ(at_once.times.back().stage, "coarse model");
    }
    PrepareOptions held;
    held.meshing.edge_length = 3.6;
    held.anchors = {2};
    EXPECT_FALSE(prepare_for_loads(shapes::organ_labels({}), held).coarse);
}

}  // namespace
}  // namespace tissuewarp::registration
