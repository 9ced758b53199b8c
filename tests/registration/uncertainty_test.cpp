/// The posterior, and what is made of it.
#include "registration/uncertainty.hpp"
#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/loads/posterior.hpp"
#include "registration/loads/unknown_bends.hpp"
#include "registration/loads/unknown_loads.hpp"
#include "registration/pose/shown_motions.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/datum_kind.hpp"
#include "registration/uncertainty/data_uncertainty.hpp"
#include "registration/uncertainty/error_model.hpp"
#include "registration/uncertainty/held_out.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/label_shapes.hpp"
#include "tled/model/internal_force.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

PreparedModel organ() {
    PrepareOptions options;
    options.meshing.edge_length = 10;
    return prepare(shapes::organ_labels({}), options);
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

/// Three places left of the middle, held by pairs where they were.
PointPairs pairs_on_the_left(double deviation_mm) {
    PointPairs pairs{Matrix3Xd(3, 4), Matrix3Xd(3, 4), deviation_mm};
    pairs.moving << -35, -25, -30, -28, 0, 10, -10, 3, 4, 0, -6, 12;
    pairs.fixed = pairs.moving;
    return pairs;
}

/// Twelve nodes.
PreparedModel brick() {
    imaging::Volume labels(test::plain_grid({60, 40, 40}, 1.0, {-10, -10, -10}), CV_32SC1);
    test::for_each_voxel(labels, [&](const Vector3d& index, std::int64_t offset) {
        const Vector3d x = labels.geometry.point(index);
        labels.data<std::int32_t>()[offset] = (x.array() > 0).all() && x[0] < 40 && x[1] < 20 && x[2] < 20;
    });
    return prepare(meshing::box_mesh({40, 20, 20}, {2, 1, 1}), labels);
}

// The simple twin: the whole stiffness, and the whole ground less what it does to rigid motions, as dense matrices.
// With the wrong sign of the correction, or springs counted twice, the figures differ by tens of percent.
TEST(Posterior, IsTheInverseOfTheDenseMatrix) {
    const PreparedModel prepared = brick();
    const int count = prepared.rest.node_count;
    ASSERT_LE(count, 16);
    detail::WeighedSprings springs;
    springs.energy = 300;
    springs.ground = detail::ground_springs(prepared, springs.energy, [](const InterfaceNode&) { return 7.0; });
    for (const int node : {0, 1, 4, 5})
        springs.data.push_back({node, Vector3d(2000, 500, 6000).asDiagonal(), Vector3d::Zero()});
    tled::Conditions all;
    all.springs = springs.data;
    all.springs.insert(all.springs.end(), springs.ground.begin(), springs.ground.end());
    const tled::RestStiffness stiffness(prepared.rest, tled::nodal_conditions(all, count));
    Eigen::MatrixXd inverse(3 * count, 3 * count), ground = Eigen::MatrixXd::Zero(3 * count, 3 * count);
    for (int k = 0; k < 3 * count; ++k) {
        Matrix3Xd force = Matrix3Xd::Zero(3, count);
        force.data()[k] = 1;
        const Matrix3Xd u = stiffness.solve(force);
        inverse.col(k) = Eigen::Map<const Eigen::VectorXd>(u.data(), 3 * count);
    }
    for (const tled::Spring& spring : springs.ground)
        ground.block<3, 3>(3 * spring.node, 3 * spring.node) += spring.stiffness;
    Eigen::MatrixXd motions(3 * count, 6);
    for (int n = 0; n < count; ++n)
        for (int axis = 0; axis < 3; ++axis) {
            motions.block<3, 1>(3 * n, axis) = Vector3d::Unit(axis);
            motions.block<3, 1>(3 * n, 3 + axis) =
                Vector3d::Unit(axis).cross(Vector3d(prepared.model.mesh.nodes.col(n)));
        }
    std::vector<tled::Spring> shown;
    for (const tled::Spring& spring : springs.data)
        shown.push_back({spring.node, Eigen::Matrix3d::Identity(), Vector3d::Zero()});
    for (const auto& placed_by : {std::vector<tled::Spring>(), springs.ground, shown}) {
        springs.placed_by = placed_by;
        Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(3 * count, 3 * count), dense = inverse.inverse();
        for (const tled::Spring& spring : placed_by)
            weights.block<3, 3>(3 * spring.node, 3 * spring.node) += spring.stiffness;
        if (!placed_by.empty())
            dense -=
                ground * motions * (motions.transpose() * weights * motions).inverse() * motions.transpose() * weights;
        const Eigen::MatrixXd expected = dense.inverse(),
                              found = detail::Posterior(prepared, springs)
                                          .inverse(Eigen::MatrixXd::Identity(3 * count, 3 * count));
        // the prior of 0.7 mm moves along a little short, so that what no datum shows is known to 100 mm
        const double tolerance = placed_by.empty() ? 1e-9 : 3e-3;
        EXPECT_LT((found - expected).norm(), tolerance * expected.norm()) << placed_by.size();
    }
}

// The far end of the organ is known worse than tissue between pairs, and is not to be trusted; pairs known ten times as
// well leave less open beside them.
TEST(Uncertainty, GrowsAwayFromTheData) {
    const PreparedModel prepared = organ();
    Matrix3Xd places(3, 3);
    places << -30, 0, 40, 0, 0, 0, 0, 0, 0;
    std::vector<double> beside;
    for (const double deviation : {1.0, 0.1}) {
        const UpdateResult result = update(prepared, {.points = pairs_on_the_left(deviation)}, on_cpu());
        const auto estimates = uncertainty(prepared, result).at(places);
        ASSERT_TRUE(estimates[0] && estimates[1] && estimates[2]);
        EXPECT_LT(estimates[0]->data_mm, 0.7 * estimates[1]->data_mm);
        EXPECT_LT(estimates[1]->data_mm, 0.8 * estimates[2]->data_mm);
        EXPECT_EQ(estimates[0]->trust, Trust::Shown);
        EXPECT_EQ(estimates[1]->trust == Trust::Unknown, estimates[1]->interval_mm > 5);
        EXPECT_NE(estimates[2]->trust, Trust::Shown);
        for (const auto& each : estimates) {
            EXPECT_GT(each->interval_mm, 1.4 * each->deviation_mm);
            EXPECT_LT(each->interval_mm, 2.0 * each->deviation_mm);
            EXPECT_GE(each->deviation_mm, (1 - 1e-9) * each->data_mm);
        }
        beside.push_back(estimates[0]->data_mm);
    }
    EXPECT_LT(beside[1], 0.9 * beside[0]);
}

TEST(Uncertainty, SaysNothingOfPlacesOutsideTheTissue) {
    const PreparedModel prepared = organ();
    const auto estimate = uncertainty(prepared, update(prepared, {.points = pairs_on_the_left(1)}, on_cpu()));
    Matrix3Xd far(3, 1);
    far << 200, 0, 0;
    EXPECT_FALSE(estimate.at(far).front());
}

// The loads turn and shift the organ nowhere, and differ from draw to draw.
TEST(Uncertainty, UnknownLoadsAreInEquilibrium) {
    const PreparedModel prepared = organ();
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Eigen::MatrixXd loads = detail::unknown_loads(prepared, 3, 5);
    for (Eigen::Index k = 0; k < loads.cols(); ++k) {
        Vector3d force = Vector3d::Zero(), moment = Vector3d::Zero();
        double scale = 0;
        for (Eigen::Index n = 0; n < nodes.cols(); ++n) {
            const Vector3d here = loads.block<3, 1>(3 * n, k), place = nodes.col(n);
            force += here;
            moment += place.cross(here);
            scale += here.norm();
        }
        EXPECT_GT(scale, 100);  // mN: about 1 kPa over the organ's surface
        EXPECT_LT(force.norm(), 1e-9 * scale);
        EXPECT_LT(moment.norm(), 1e-7 * scale);
    }
    EXPECT_EQ(loads, detail::unknown_loads(prepared, 3, 5));
    const Eigen::MatrixXd bodies = detail::unknown_body_forces(prepared, 2, 5);
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_LT(std::abs(bodies.col(0)(Eigen::seq(axis, Eigen::last, 3)).sum()), 1e-9 * bodies.cwiseAbs().sum());
    EXPECT_GT(bodies.norm(), 0);
    EXPECT_LT(std::abs(loads.col(0).normalized().dot(loads.col(1).normalized())), 0.9);
}

// Pairs at one end show too little, pairs all over enough.
TEST(Uncertainty, TellsWhetherPointsShowEnough) {
    const PreparedModel prepared = organ();
    PointPairs all_over = pairs_on_the_left(1);
    all_over.moving.conservativeResize(3, 10);
    all_over.moving.rightCols(6) << 30, 28, 0, 0, 5, -5, 0, 6, 18, -18, 0, 0, 3, -6, 0, 0, 14, -14;
    all_over.fixed = all_over.moving;
    PointPairs line = pairs_on_the_left(1);
    line.moving.row(1).setZero();
    line.moving.row(2).setZero();
    line.fixed = line.moving;
    const auto doubts = [&](const PointPairs& pairs) {
        return test::codes(doubts_of(uncertainty(prepared, update(prepared, {.points = pairs}, on_cpu())), 1));
    };
    EXPECT_THAT(doubts(line), testing::Contains("data.show_too_little"));
    EXPECT_THAT(doubts(all_over), testing::IsEmpty());
}

// By the share of the tissue whose radius is beyond a centimetre.
TEST(Uncertainty, DoubtsDataThatLeaveAQuarterOfTheTissueUnknown) {
    UncertaintySummary summary;
    summary.failed_share = 0.24;
    EXPECT_FALSE(doubt_of_data(summary));
    summary.failed_share = 0.26;
    const auto doubt = doubt_of_data(summary);
    ASSERT_TRUE(doubt);
    EXPECT_EQ(doubt->code, "data.show_too_little");
    EXPECT_NE(doubt->text.find("26 % of its tissue may lie more than 10 mm"), std::string::npos) << doubt->text;
    summary = {};
    summary.poor_share = 0.74;
    EXPECT_FALSE(doubt_of_data(summary));
    summary.poor_share = 0.76;
    ASSERT_TRUE(doubt_of_data(summary));
    EXPECT_NE(doubt_of_data(summary)->text.find("76 % of its tissue may lie more than 5 mm"), std::string::npos);
}

TEST(CoarseTwin, CarriesLinearFieldsAndAllOfTheStiffness) {
    const PreparedModel prepared = organ();
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Matrix3Xd inside = 0.7 * nodes.leftCols(50);
    EXPECT_LT((detail::carried(prepared.model.mesh, 2 * nodes, inside) - 2 * inside).cwiseAbs().maxCoeff(), 1e-9);
    PointPairs pairs = pairs_on_the_left(1);
    const UpdateResult result = update(prepared, {.points = pairs}, on_cpu());
    const PreparedModel coarse = detail::coarse_model_for_loads(prepared, silent_observer());
    const LastPulls twin = detail::pulls_on(coarse, prepared, result.pulls);
    const auto trace = [](const std::vector<tled::Spring>& springs) {
        double sum = 0;
        for (const tled::Spring& spring : springs) sum += spring.stiffness.trace();
        return sum;
    };
    EXPECT_NEAR(trace(twin.of(Origin::Datum)) / trace(result.pulls.of(Origin::Datum)), 1, 1e-9);
    EXPECT_NEAR(trace(twin.of(Origin::Prior)) / trace(result.pulls.of(Origin::Prior)), 1, 0.01);
}

// The simple twin: the factor of the large mesh. Springs added up along other normals, displacements of other nodes, or
// covariances of another order are off by half and more.
TEST(Uncertainty, OfLargeMeshesIsThatOfTheirFactorNearly) {
    PrepareOptions options;
    options.meshing.edge_length = 2.7;
    const PreparedModel large = prepare(shapes::organ_labels({}), options);
    ASSERT_TRUE(large.stiffness.is_large()) << large.rest.node_count;
    PointPairs all_over = pairs_on_the_left(1);
    all_over.fixed.row(1).array() += 3;
    for (const Intraoperative& seen : {Intraoperative{.labels = large.labels}, Intraoperative{.points = all_over}}) {
        const UpdateResult result = update(large, seen, on_cpu());
        const Uncertainty found = uncertainty(large, result);
        const detail::DataUncertainty exact =
            detail::open_parts(large, result.pulls, result.deformation.displacement,
                               tled::elastic_energy(large.rest, result.deformation.displacement), {})
                .data;
        const std::vector<ErrorEstimate> nodal = found.at_nodes();
        double about = 0, expected = 0;
        for (std::size_t n = 0; n < nodal.size(); ++n) {
            about += nodal[n].data_mm * nodal[n].data_mm;
            expected += exact.covariance.col(static_cast<Eigen::Index>(n)).head<3>().sum();
            EXPECT_TRUE(std::isfinite(nodal[n].discretisation_mm));
        }
        // Four pairs at one end pull at few nodes of the coarser model: what the rest does hangs on where these lie.
        EXPECT_NEAR(std::sqrt(about / expected), 1, seen.points ? 0.2 : 0.15);
    }
}

// Labels pull along normals; what holds nodes where they are is kept apart, or it would count as knowledge.
TEST(Uncertainty, HoldsOfLabelsAreNoData) {
    const PreparedModel prepared = organ();
    const UpdateResult result = update(prepared, {.labels = prepared.labels}, on_cpu());
    ASSERT_FALSE(result.pulls.of(Origin::Hold).empty());
    for (const tled::Spring& spring : result.pulls.of(Origin::Datum))
        EXPECT_NEAR(spring.stiffness.determinant(), 0, 1e-6 * std::pow(spring.stiffness.trace(), 3));
}

/// Errors of the same variances along the axes everywhere.
NodalErrors nodal_of(const Vector3d& variances, Eigen::Index count) {
    NodalErrors nodal;
    nodal.algebraic = nodal.discretisation = Eigen::RowVectorXd::Zero(count);
    nodal.data = Eigen::RowVectorXd::Constant(count, variances.sum());
    nodal.covariance = Eigen::MatrixXd::Zero(6, count);
    nodal.covariance.topRows<3>().colwise() = variances;
    nodal.shown.assign(static_cast<std::size_t>(count), 1);
    return nodal;
}

// The three classes by their stated meaning: 5 mm with 95 %, and data near.
TEST(Uncertainty, TrustIsWhatItSays) {
    const PreparedModel prepared = organ();
    const Eigen::Index count = prepared.model.mesh.nodes.cols();
    const auto trust = [&](double variance, bool shown, bool placed) {
        NodalErrors nodal = nodal_of(Vector3d::Constant(variance), count);
        if (!shown) nodal.shown[std::size_t(prepared.model.mesh.tets(2, 0))] = 0;  // one corner suffices
        nodal.placed = placed;
        return Uncertainty(prepared.model.mesh, nodal).at(0, Eigen::Vector4d::Constant(0.25)).trust;
    };
    const double five_mm = std::pow(5 / 3.084, 2);  // see below
    EXPECT_EQ(trust(0.9 * five_mm, true, true), Trust::Shown);
    EXPECT_EQ(trust(0.9 * five_mm, false, true), Trust::Carried);
    EXPECT_EQ(trust(1.1 * five_mm, true, true), Trust::Unknown);
    EXPECT_EQ(trust(0.1, true, false), Trust::Unknown);
}

// The interval's quantile, from tables of F: errors of three equal deviations, of one alone, of two, over a scale that
// six numbers tell: √(n · 4/6 · F₀.₉₅(n, 6)).
TEST(Uncertainty, IntervalsAreThoseOfErrorsOfUncertainSize) {
    const PreparedModel prepared = organ();
    const Eigen::Index count = prepared.model.mesh.nodes.cols();
    const auto interval = [&](const Vector3d& variances) {
        return Uncertainty(prepared.model.mesh, nodal_of(variances, count)).at_nodes().front().interval_mm;
    };
    EXPECT_NEAR(interval({1, 1, 1}), 3.084, 0.05);
    EXPECT_NEAR(interval({4, 0, 0}), 3.996, 0.1);
    EXPECT_NEAR(interval({1, 1, 0}), 2.619, 0.05);
    EXPECT_EQ(interval({0, 0, 0}), 0);
}

// On the grid: numbers in the tissue alone, the same as at the places of the moving frame that the voxels show.
TEST(Uncertainty, LiesOnTheGridWhereTheTissueWent) {
    const PreparedModel prepared = organ();
    PointPairs pairs = pairs_on_the_left(1);
    pairs.fixed = test::motion(20, {0, 0, 1}, {15, 5, -3}) * pairs.fixed;
    const UpdateResult result = update(prepared, {.points = pairs}, on_cpu());
    const Uncertainty estimate = uncertainty(prepared, result);
    imaging::Geometry grid = prepared.labels.geometry;
    grid.origin += Vector3d(10, 5, 0);
    const UncertaintyVolumes volumes = uncertainty_on_grid(estimate, result.deformation, grid);
    const imaging::Volume back = displacement_fixed_to_moving(result.deformation, grid);
    int inside = 0, classes = 0;
    for (std::int64_t v = 0; v < grid.voxel_count(); v += 997) {
        const float deviation = volumes.deviation.data<float>()[v];
        const auto trust = Trust(volumes.trust.data<unsigned char>()[v]);
        EXPECT_EQ(std::isnan(deviation), trust == Trust::Outside);
        if (trust == Trust::Outside) continue;
        ++inside;
        const int i = int(v % grid.size[0]), j = int(v / grid.size[0] % grid.size[1]),
                  k = int(v / grid.size[0] / grid.size[1]);
        const cv::Vec3f& shift = back.data<cv::Vec3f>()[v];
        const Vector3d place = grid.point(Vector3d(i, j, k)) + Vector3d(shift[0], shift[1], shift[2]);
        const auto there = estimate.at(place);
        ASSERT_TRUE(there.front());
        EXPECT_NEAR(deviation / there.front()->deviation_mm, 1, 0.01);  // the field's float32, at the element's edge
        classes += trust != there.front()->trust;
    }
    EXPECT_LE(classes, 1) << "of voxels and places that are called otherwise";
    EXPECT_GT(inside, 50);
}

/// Pulls of a hundred nodes or so at the surface to where they are.
LastPulls pulls_at_the_surface(const PreparedModel& prepared, double shared_mm) {
    LastPulls pulls;
    pulls.energy = 40;
    for (const InterfaceNode& node : prepared.interfaces.nodes())
        pulls.springs.push_back(
            {{node.node, 400 * Eigen::Matrix3d::Identity(), Vector3d::Zero()}, Origin::Datum, shared_mm, 10});
    for (const tled::Spring& spring :
         detail::ground_springs(prepared, pulls.energy, [](const InterfaceNode&) { return 20.0; }))
        pulls.springs.push_back({spring, Origin::Prior});
    pulls.loads.setZero(3, prepared.rest.node_count);
    return pulls;
}

// The simple twin: matrices written out. With another prior than that of the truth the registration is drawn to it.
TEST(LinearRegistration, MissesWhatItsEquationsSay) {
    const PreparedModel prepared = organ();
    LastPulls unseen = pulls_at_the_surface(prepared, 0), pulls = unseen;
    for (PulledNode& pulled : pulls.springs)
        if (pulled.origin == Origin::Prior) pulled.spring.stiffness *= 50;
    const auto [registration, without] = detail::LinearRegistration::with_unseen(prepared, pulls, unseen);
    detail::Truths truths;
    truths.loads = detail::unknown_body_forces(prepared, 2, 3);
    truths.displacement = without.inverse(truths.loads);
    const Eigen::MatrixXd missed = registration.missed(truths);
    // û from its own equation: (K + G' + K_D) û = K_D u
    const Eigen::MatrixXd found = registration.inverse(detail::forces_of(pulls.of(Origin::Datum), truths.displacement));
    EXPECT_LT((truths.displacement - missed - found).norm(), 1e-9 * truths.displacement.norm());
    EXPECT_GT(missed.norm(), 0.01 * truths.displacement.norm());
}

// However many data say the same wrong thing, it stays wrong by as much.
TEST(LinearRegistration, SharedErrorsDoNotAverageOut) {
    const PreparedModel prepared = organ();
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    double deviation[2];
    for (const int shared : {0, 1}) {
        const LastPulls pulls = pulls_at_the_surface(prepared, 0.5 * shared);
        const detail::LinearRegistration registration =
            detail::LinearRegistration::with_unseen(prepared, pulls, pulls).first;
        const detail::DataErrors errors = detail::drawn_errors(pulls.data(), nodes, pulls.energy, 200, 7);
        const Eigen::MatrixXd moved =
            registration.inverse(detail::forces_of(pulls.data(), errors, prepared.rest.node_count));
        double sum = 0;
        for (const InterfaceNode& node : prepared.interfaces.nodes())
            sum += moved.middleRows<3>(3 * node.node).squaredNorm() / 200;
        deviation[shared] = std::sqrt(sum / double(prepared.interfaces.nodes().size()));
    }
    EXPECT_LT(deviation[0], 0.12);  // σ of one: √(0.05 · 40/400) = 0.07 along each axis
    EXPECT_NEAR(deviation[1], 0.5 * std::sqrt(3), 0.15);
}

// Of a motion that springs feel a quarter as much as where nothing is added, or less, all of the deviation.
TEST(OpenParts, MotionsThatDataHardlyTellCount) {
    const PreparedModel prepared = organ();
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Matrix3Xd still = Matrix3Xd::Zero(3, nodes.cols());
    LastPulls pulls = pulls_at_the_surface(prepared, 0.3);
    pulls.placement_sought = true;
    const auto mean_square = [&] {
        const auto open = detail::open_parts(prepared, pulls, still, 1, {});
        return open.data.covariance.topRows<3>().sum() / double(nodes.cols());
    };
    const double before = mean_square();
    pulls.hardly_shown = {3, 0.5};
    const auto shares = detail::shown_motions(pulls, nodes).shares;
    ASSERT_LT(shares.maxCoeff(), 0.5);
    EXPECT_NEAR(mean_square() - before, 9 * ((0.5 / shares.array()).sqrt() - 1).min(1).square().sum(), 1e-6);
    pulls.hardly_shown = {3, shares.minCoeff()};
    EXPECT_NEAR(mean_square(), before, 1e-9);
    pulls.placement_sought = false;  // headers place the organ
    pulls.hardly_shown = {3, 0.5};
    EXPECT_LT(mean_square(), before + 1e-9);
}

// What the linear registration misses is what its definition says: u − S K_D u.
TEST(LinearRegistration, MissesWhatItsDataAndItsLoadsLeave) {
    const PreparedModel prepared = organ();
    LastPulls pulls = pulls_at_the_surface(prepared, 0.3);
    pulls.prior_moves = PriorMoves::WithSurface;
    auto [registration, without] = detail::LinearRegistration::with_unseen(prepared, pulls, pulls);
    detail::Truths truths;
    truths.loads = detail::unknown_bends(prepared, 3, 9);
    truths.displacement = without.inverse(truths.loads);
    const auto left = [&](const detail::LinearRegistration& r) {
        return Eigen::MatrixXd(truths.displacement -
                               r.inverse(detail::forces_of(pulls.of(Origin::Datum), truths.displacement)));
    };
    const Eigen::MatrixXd alone = registration.missed(truths);
    EXPECT_LT((alone - left(registration)).norm(), 1e-6 * truths.displacement.norm());
    registration =
        std::move(registration).with_loads({{detail::principal_bends(prepared, 48).loads, without, pulls.energy}, 50});
    const Eigen::MatrixXd loaded = registration.missed(truths);
    EXPECT_LT((loaded - left(registration)).norm(), 1e-6 * truths.displacement.norm());
    EXPECT_LT(loaded.norm(), 0.9 * alone.norm());
}

// By energy alone sixteen times as much would be sixteen times the variance.
TEST(OpenParts, StrainThatMovedTheTissueLittleCountsLess) {
    const PreparedModel prepared = organ();
    const Matrix3Xd& nodes = prepared.model.mesh.nodes;
    LastPulls pulls = pulls_at_the_surface(prepared, 0.3);
    const auto variance = [&](double energy, double bent_mm) {
        Matrix3Xd bent = Matrix3Xd::Zero(3, nodes.cols());
        bent.row(2) = bent_mm * (nodes.row(0) / 40).array().square();
        for (PulledNode& pulled : pulls.springs) pulled.spring.target = bent.col(pulled.spring.node);
        const auto open = detail::open_parts(prepared, pulls, bent, energy, {});
        return open.data.covariance.topRows<3>().sum();
    };
    const auto growth = [&](double energy, double bent_mm) {
        const double once = variance(energy, bent_mm), more = variance(16 * energy, bent_mm);
        return (variance(256 * energy, bent_mm) - more) / (more - once);
    };
    const double much = 1e3 * pulls.energy;
    EXPECT_NEAR(growth(much, 0.2), 16, 0.1);  // data show the organ as a whole
    pulls.prior_moves = PriorMoves::WithData;
    EXPECT_NEAR(growth(much, 0.2), std::pow(16, 1 - detail::error_model.motion_weight), 0.1);
    EXPECT_NEAR(growth(pulls.energy, 30), 16, 0.1);  // it moved as far as its strain says
}

// Labels that turned the organ may hide more of a turn; where headers place it nothing is added.
TEST(OpenParts, WhatLabelsHideGrowsWithTheTurnThatTheyShow) {
    const PreparedModel prepared = organ();
    const Eigen::Isometry3d turn(Eigen::AngleAxisd(0.2, Vector3d(0.6, 0, 0.8)));
    imaging::Volume turned = prepared.labels;
    turned.geometry.origin = turn * turned.geometry.origin;
    turned.geometry.direction = turn.linear() * turned.geometry.direction;
    UpdateOptions options = on_cpu();
    EXPECT_LT(update(prepared, {.labels = prepared.labels}, options).pulls.hardly_shown.deviation_mm, 0.1);
    const Matrix3Xd arms = prepared.model.mesh.nodes.colwise() - prepared.model.mesh.nodes.rowwise().mean();
    const double turned_mm = std::sqrt((turn.linear() * arms - arms).colwise().squaredNorm().mean());
    ASSERT_GT(turned_mm, 3);
    EXPECT_NEAR(update(prepared, {.labels = turned}, options).pulls.hardly_shown.deviation_mm,
                detail::hardly_told_motions.labels.of_turn * turned_mm, 0.2);
    options.align = false;
    EXPECT_EQ(update(prepared, {.labels = prepared.labels}, options).pulls.hardly_shown.deviation_mm, 0);
}

/// Data that lie where one of the truths and errors of the estimate itself puts them.
double z_of_drawn_data(const PreparedModel& prepared, double factor, PriorMoves prior_moves = PriorMoves::Not,
                       const detail::HeldOutOptions& options = {}, bool finds_loads = false) {
    LastPulls pulls = pulls_at_the_surface(prepared, 0.3);
    pulls.prior_moves = prior_moves;
    auto [registration, without] = detail::LinearRegistration::with_unseen(prepared, pulls, pulls);
    if (finds_loads)
        registration = std::move(registration)
                           .with_loads({{detail::principal_bends(prepared, 20).loads, without, pulls.energy}, 10});
    const Eigen::MatrixXd truths = without.inverse(40 * detail::unknown_loads(prepared, 17, 3));
    const auto errors = detail::drawn_errors(pulls.data(), prepared.model.mesh.nodes, pulls.energy, 17, 7);
    std::size_t datum = 0;
    for (PulledNode& pulled : pulls.springs) {
        if (pulled.origin != Origin::Datum) continue;
        pulled.spring.target = factor * (truths.block<3, 1>(3 * pulled.spring.node, 16) + errors[datum++].col(16));
    }
    const Eigen::VectorXd found = registration.inverse([&] {
        Eigen::MatrixXd forces = Eigen::MatrixXd::Zero(3 * Eigen::Index{prepared.rest.node_count}, 1);
        for (const PulledNode& pulled : pulls.data())
            forces.middleRows<3>(3 * pulled.spring.node) += pulled.spring.stiffness * pulled.spring.target;
        return forces;
    }());
    detail::DataErrors others;
    for (const Eigen::MatrixXd& each : errors) others.emplace_back(each.leftCols(16));
    const auto result = detail::held_out(prepared, pulls, registration.posterior(),
                                         Eigen::Map<const Matrix3Xd>(found.data(), 3, found.size() / 3),
                                         truths.leftCols(16), others, options);
    EXPECT_TRUE(result.has_value());
    EXPECT_GE(result->regions, 8);
    return result->z;
}

TEST(HeldOut, IsOneForDataOfTheStatedKindAndScalesWithThem) {
    const PreparedModel prepared = organ();
    const double z = z_of_drawn_data(prepared, 1);
    EXPECT_GT(z, 0.6);
    EXPECT_LT(z, 1.7);
    EXPECT_NEAR(z_of_drawn_data(prepared, 3) / z, 3, 1e-6);
}

// The slow twin: a factor of what is left without each fold.
TEST(HeldOut, TakesSpringsOutOfTheInverseAsAFactorWithoutThemDoes) {
    const PreparedModel prepared = organ();
    for (const PriorMoves moves : {PriorMoves::Not, PriorMoves::WithSurface})
        for (const bool finds_loads : {false, true}) {
            const double with_factors = z_of_drawn_data(prepared, 2, moves, {.most_nodes_between = 0}, finds_loads),
                         taken_out = z_of_drawn_data(prepared, 2, moves, {.most_nodes_between = 10000}, finds_loads);
            EXPECT_NEAR(taken_out / with_factors, 1, 1e-6);
        }
}

TEST(HeldOut, SaysNothingOfThreeData) {
    const PreparedModel prepared = organ();
    LastPulls pulls = pulls_at_the_surface(prepared, 0);
    int kept = 0;
    std::erase_if(pulls.springs,
                  [&](const PulledNode& pulled) { return pulled.origin == Origin::Datum && ++kept > 3; });
    const Matrix3Xd none = Matrix3Xd::Zero(3, prepared.rest.node_count);
    const detail::LoadedPosterior all(detail::Posterior(prepared, detail::with_data(pulls)));
    EXPECT_FALSE(detail::held_out(prepared, pulls, all, none, {}, detail::DataErrors(3)).has_value());
}

TEST(HeldOut, DoubtsDataThatContradictEachOther) {
    EXPECT_FALSE(doubt_of_held_out({2.0, 12}));
    const auto doubt = doubt_of_held_out({2.6, 12});
    ASSERT_TRUE(doubt.has_value());
    EXPECT_EQ(doubt->code, "data.contradict");
    EXPECT_NE(doubt->text.find("2.6 times"), std::string::npos);
}

TEST(Uncertainty, RefusesAResultOfAnotherModel) {
    const PreparedModel prepared = organ();
    UpdateResult result = update(prepared, {.points = pairs_on_the_left(1)}, on_cpu());
    result.deformation.displacement.conservativeResize(3, 5);
    EXPECT_THROW(uncertainty(prepared, result), InvalidInput);
}

// More than the tolerance is said, in both figures; up to it nothing is.
TEST(Uncertainty, DoubtsASolverThatStoppedFarFromEquilibrium) {
    UncertaintySummary summary;
    summary.algebraic_mm = 0.05;
    EXPECT_FALSE(doubt_of_solver(summary, 0.05));
    summary.algebraic_mm = 0.3;
    const std::string doubt = doubt_of_solver(summary, 0.05).value().text;
    EXPECT_NE(doubt.find("0.3 mm"), std::string::npos) << doubt;
    EXPECT_NE(doubt.find("0.05 mm"), std::string::npos) << doubt;
}

TEST(Uncertainty, AnAccuracyThatIsNotSureIsDoubted) {
    UncertaintySummary summary;
    summary.deviation_mm = summary.data_mm = 0.9;
    summary.interval_mm = 1.5;
    EXPECT_FALSE(doubt_of_accuracy(summary, 1.5));
    const std::string doubt = doubt_of_accuracy(summary, 1).value().text;  // more than the deviation is not enough
    EXPECT_NE(doubt.find("1 mm were asked for"), std::string::npos) << doubt;
    EXPECT_NE(doubt.find("within 1.5 mm"), std::string::npos) << doubt;
    EXPECT_NE(doubt.find("better data would help"), std::string::npos) << doubt;
    summary.discretisation_mm = 2;
    EXPECT_NE(doubt_of_accuracy(summary, 1)->text.find("; a finer mesh would help"), std::string::npos);
}

}  // namespace
}  // namespace tissuewarp::registration
