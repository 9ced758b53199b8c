#include "registration/uncertainty.hpp"

#include "core/errors.hpp"
#include "meshing/search/point_tree.hpp"
#include "registration/doubts.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/springs/conditions.hpp"
#include "registration/springs/pull.hpp"
#include "registration/uncertainty/data_uncertainty.hpp"
#include "registration/uncertainty/error_model.hpp"
#include "tled/error/lifted_residual.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/model/symmetric.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <string>

namespace tissuewarp::registration {

namespace {

constexpr double freedom_of_size = detail::error_model.freedom_of_size;

void require_related(const PreparedModel& prepared, const UpdateResult& result) {
    const Eigen::Index nodes = prepared.model.mesh.nodes.cols();
    if (result.deformation.displacement.cols() != nodes || result.pulls.loads.cols() != nodes)
        throw InvalidInput("the result has displacements of " + std::to_string(result.deformation.displacement.cols()) +
                           " nodes and the model " + std::to_string(nodes) + "; give the model that was registered");
    if (!result.deformation.displacement.allFinite())
        throw InvalidInput("the result holds displacements that are not finite");
}

/// Displacement of the result in the frame that the last round's springs pull in: the placement took a rigid part of it
/// afterwards.
Eigen::Matrix3Xd displacement_under_pulls(const UpdateResult& result) {
    const Eigen::Isometry3d back = result.pulls.placement.inverse() * result.deformation.placement;
    const Eigen::Matrix3Xd& rest = result.deformation.mesh.nodes;
    return back * (rest + result.deformation.displacement) - rest;
}

/// What the last round's equilibrium was under.
tled::NodalConditions conditions_of(const PreparedModel& prepared, const LastPulls& pulls) {
    tled::Conditions conditions;
    for (const PulledNode& pulled : pulls.springs) conditions.springs.push_back(pulled.spring);
    conditions.external_force = pulls.loads;
    return detail::conditions_on(prepared, std::move(conditions));
}

/// Points of a part of the surface alone: where an organ of smooth shape lies may be told wrong, by more than any
/// estimate about the place that was found says.
bool place_is_uncertain(const UpdateResult& result) {
    return result.pulls.prior_moves == PriorMoves::WithSurface && result.surface && !result.points && !result.curves;
}

/// x with Φ(x) = probability, by Newton's method.
double normal_quantile(double probability) {
    double x = 0;
    for (int iteration = 0; iteration < 30; ++iteration)
        x -= (0.5 * std::erfc(-x / std::sqrt(2.0)) - probability) * std::sqrt(2 * EIGEN_PI) * std::exp(0.5 * x * x);
    return x;
}

// ‖e‖² over its mean is a multiple of χ² (Satterthwaite, Biometrics 2 (1946) 110) whose scale is itself known from few
// numbers: F. Its quantile is that of a normal ratio of cube roots (Paulson, Ann Math Statist 13 (1942) 233).
double radius_mm(const Eigen::Matrix3d& covariance, double z) {
    const double mean = covariance.trace();
    if (!(mean > 0)) return 0;
    const double freedom = mean * mean / covariance.squaredNorm();
    const double a = 2 / (9 * freedom), b = 2 / (9 * freedom_of_size);
    // ((1 − b) y − (1 − a))² = z² (b y² + a), the root on z's side
    const double square = (1 - b) * (1 - b) - z * z * b, middle = (1 - a) * (1 - b),
                 rest = (1 - a) * (1 - a) - z * z * a;
    const double root = std::sqrt(std::max(0.0, middle * middle - square * rest));
    const double y = std::max(0.0, (middle + (z < 0 ? -root : root)) / square);
    return std::sqrt(mean * (freedom_of_size - 2) / freedom_of_size * y * y * y);
}

/// What data leave open of a model, found on its coarser one: a factor of a large model takes long and says nothing
/// else, since what data leave open varies smoothly.
detail::DataUncertainty open_on_coarse(const PreparedModel& prepared, const PreparedModel& coarse,
                                       const LastPulls& given, const Eigen::Matrix3Xd& displacement,
                                       const UncertaintyOptions& options) {
    // Targets from where the tissue is: a coarse node lies elsewhere and moved otherwise than the one whose spring it
    // has.
    LastPulls residuals = given;
    for (PulledNode& pulled : residuals.springs) pulled.spring.target -= displacement.col(pulled.spring.node);
    LastPulls pulls = detail::pulls_on(coarse, prepared, residuals);
    const Eigen::Matrix3Xd there = detail::carried(prepared, displacement, coarse);
    for (PulledNode& pulled : pulls.springs) pulled.spring.target += there.col(pulled.spring.node);
    const double energy = tled::elastic_energy(prepared.rest, displacement);
    detail::DataUncertainty data = detail::open_parts(coarse, pulls, there, energy, options).data;
    data.covariance = detail::carried(coarse, data.covariance, prepared);
    return data;
}

/// Of the solver and of the mesh.
struct NumericalErrors {
    Eigen::Matrix3Xd algebraic;  // 3 × N, mm
    tled::DiscretisationEstimate mesh;
};

NumericalErrors numerical_errors(const PreparedModel& prepared, const tled::RestStiffness& stiffness,
                                 const tled::NodalConditions& conditions, const Eigen::Matrix3Xd& displacement) {
    // First: what it takes before it solves is gone when the factor is made.
    tled::DiscretisationEstimate mesh = tled::discretisation_error(prepared.model, stiffness, conditions, displacement);
    return {tled::lifted_residual(prepared.rest, stiffness, conditions, displacement), std::move(mesh)};
}

struct AllErrors {
    detail::DataUncertainty data;
    NumericalErrors numerical;
};

/// Of a model of so many nodes or fewer one factor serves all. Of a larger one its own, which takes most memory, is
/// gone before those of the coarser model are made.
AllErrors all_errors(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options,
                     Observer& observer) {
    const Eigen::Matrix3Xd displacement = displacement_under_pulls(result);
    const tled::NodalConditions conditions = conditions_of(prepared, result.pulls);
    AllErrors errors;
    if (!detail::loads_take_coarse_model(prepared)) {
        const double energy = tled::elastic_energy(prepared.rest, displacement);
        detail::OpenParts open = detail::open_parts(prepared, result.pulls, displacement, energy, options);
        observer.checkpoint("error estimate", 0.6);
        errors.data = std::move(open.data);
        errors.numerical = numerical_errors(prepared, open.stiffness, conditions, displacement);
        return errors;
    }
    std::optional<PreparedModel> made;
    if (!prepared.coarse) made = detail::coarse_model_for_loads(prepared, observer);
    const PreparedModel& coarse = made ? *made : *prepared.coarse;
    errors.numerical =
        numerical_errors(prepared, {prepared.rest, conditions, prepared.stiffness}, conditions, displacement);
    observer.checkpoint("error estimate", 0.6);
    errors.data = open_on_coarse(prepared, coarse, result.pulls, displacement, options);
    return errors;
}

/// Whether data show the tissue about each node.
std::vector<char> shown_nodes(const PreparedModel& prepared, const LastPulls& pulls) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    std::vector<char> shown(static_cast<std::size_t>(nodes.cols()), 0);
    std::map<double, std::vector<Eigen::Vector3d>> by_reach;
    for (const PulledNode& pulled : pulls.data())
        if (pulled.shows_mm >= 0 && pulled.spring.stiffness.trace() > 0)
            by_reach[pulled.shows_mm].emplace_back(nodes.col(pulled.spring.node));
    for (const auto& [reach, places] : by_reach) {
        const meshing::PointTree tree(places);
        for (Eigen::Index n = 0; n < nodes.cols(); ++n)
            shown[static_cast<std::size_t>(n)] |= tree.any_within(nodes.col(n), std::max(reach, 1e-6));
    }
    return shown;
}

using Covariances = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// At the nodes the mean of e eᵀ over the elements around, by four points of each.
Covariances squares_of(const tled::DiscretisationError& error, const meshing::TetMesh& mesh) {
    constexpr double near = 0.5854101966249685, far = 0.1381966011250105;  // exact for quadratics (Hammer et al. 1956)
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    Covariances sum = Covariances::Zero(6, mesh.nodes.cols());
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(mesh.nodes.cols());
    for (int tet = 0; tet < mesh.tets.cols(); ++tet) {
        Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
        for (int point = 0; point < 4; ++point) {
            Eigen::Vector4d barycentric = Eigen::Vector4d::Constant(far);
            barycentric[point] = near;
            const Eigen::Vector3d e = error.at(mesh, tet, barycentric);
            square += 0.25 * e * e.transpose();
        }
        for (const int node : mesh.tets.col(tet)) {
            sum.col(node) += volumes[tet] * tled::symmetric_entries(square);
            weights[node] += volumes[tet];
        }
    }
    return sum.array().rowwise() / weights.transpose().array();
}

Eigen::RowVectorXd traces(const Covariances& covariances) {
    return covariances.topRows<3>().colwise().sum();
}

}  // namespace

Uncertainty::Uncertainty(meshing::TetMesh mesh, NodalErrors nodal, std::optional<HeldOut> held_out)
    : mesh_(std::move(mesh)), locator_(mesh_), nodal_(std::move(nodal)), held_out_(held_out) {}

ErrorEstimate Uncertainty::at(int tet, const Eigen::Vector4d& barycentric) const {
    const auto corners = mesh_.tets.col(tet);
    const auto root = [&](const Eigen::RowVectorXd& squares) {
        double sum = 0;
        for (int c = 0; c < 4; ++c) sum += barycentric[c] * squares[corners[c]];
        return std::sqrt(sum);
    };
    tled::SymmetricEntries covariance = tled::SymmetricEntries::Zero();
    for (int c = 0; c < 4; ++c) covariance += barycentric[c] * nodal_.covariance.col(corners[c]);
    ErrorEstimate result;
    result.algebraic_mm = root(nodal_.algebraic);
    result.discretisation_mm = root(nodal_.discretisation);
    result.data_mm = root(nodal_.data);
    result.covariance = tled::symmetric_matrix(covariance);
    result.deviation_mm = std::sqrt(result.covariance.trace());
    static const double z_95 = normal_quantile(0.95);
    const bool told = result.covariance.allFinite();  // not by data that no motion of the tissue would change
    result.interval_mm = told ? radius_mm(result.covariance, z_95) : std::numeric_limits<double>::quiet_NaN();
    const bool shown = std::all_of(corners.begin(), corners.end(),
                                   [&](int node) { return nodal_.shown[static_cast<std::size_t>(node)] != 0; });
    result.trust = !nodal_.placed || !(result.interval_mm <= detail::error_model.failed_mm) ? Trust::Unknown
                   : shown                                                                  ? Trust::Shown
                                                                                            : Trust::Carried;
    return result;
}

std::vector<ErrorEstimate> Uncertainty::at_nodes() const {
    std::vector<ErrorEstimate> result(static_cast<std::size_t>(mesh_.nodes.cols()));
    for (int tet = 0; tet < mesh_.tets.cols(); ++tet)
        for (int corner = 0; corner < 4; ++corner) {
            ErrorEstimate& here = result[static_cast<std::size_t>(mesh_.tets(corner, tet))];
            if (here.deviation_mm == 0) here = at(tet, Eigen::Vector4d::Unit(corner));
        }
    return result;
}

std::vector<std::optional<ErrorEstimate>> Uncertainty::at(const Eigen::Matrix3Xd& points) const {
    std::vector<std::optional<ErrorEstimate>> result;
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
        const auto place = detail::locate_near(locator_, points.col(p));
        result.emplace_back();
        if (place) result.back() = at(place->tet, place->barycentric);
    }
    return result;
}

UncertaintySummary summarise(const Uncertainty& uncertainty) {
    const meshing::TetMesh& mesh = uncertainty.mesh();
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    Eigen::VectorXd share = Eigen::VectorXd::Zero(mesh.nodes.cols());
    for (Eigen::Index tet = 0; tet < volumes.size(); ++tet)
        for (const int node : mesh.tets.col(tet)) share[node] += volumes[tet] / 4;
    share /= share.sum();
    const std::vector<ErrorEstimate> nodal = uncertainty.at_nodes();
    UncertaintySummary sum;
    for (Eigen::Index n = 0; n < share.size(); ++n) {
        const ErrorEstimate& here = nodal[static_cast<std::size_t>(n)];
        const auto square = [](double x) { return x * x; };
        sum.algebraic_mm += share[n] * square(here.algebraic_mm);
        sum.discretisation_mm += share[n] * square(here.discretisation_mm);
        sum.data_mm += share[n] * square(here.data_mm);
        sum.deviation_mm += share[n] * square(here.deviation_mm);
        sum.interval_mm += share[n] * here.interval_mm;
        if (here.trust == Trust::Shown) sum.shown_share += share[n];
        if (here.trust == Trust::Unknown) sum.unknown_share += share[n];
        if (!(here.interval_mm <= data_doubt_limits.failed_mm)) sum.failed_share += share[n];
        if (!(here.interval_mm <= data_doubt_limits.poor_mm)) sum.poor_share += share[n];
        if (here.interval_mm <= sum.worst_interval_mm) continue;
        sum.worst_interval_mm = here.interval_mm;
        sum.worst_place = mesh.nodes.col(n);
    }
    for (double* squared : {&sum.algebraic_mm, &sum.discretisation_mm, &sum.data_mm, &sum.deviation_mm})
        *squared = std::sqrt(*squared);
    return sum;
}

Uncertainty uncertainty(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options,
                        Observer& observer) {
    require_related(prepared, result);
    observer.checkpoint("error estimate", 0.0);
    const AllErrors errors = all_errors(prepared, result, options, observer);
    const Eigen::Matrix3Xd& algebraic = errors.numerical.algebraic;
    const tled::DiscretisationEstimate& mesh = errors.numerical.mesh;
    if (!mesh.error) observer.note("no estimate of the error of the mesh: " + mesh.reason);
    observer.checkpoint("error estimate", 1.0);
    NodalErrors nodal;
    nodal.algebraic = algebraic.colwise().squaredNorm();
    nodal.data = traces(errors.data.covariance);
    nodal.covariance = errors.data.covariance;
    for (Eigen::Index n = 0; n < algebraic.cols(); ++n)
        nodal.covariance.col(n) += tled::symmetric_entries(algebraic.col(n) * algebraic.col(n).transpose());
    nodal.discretisation.setConstant(algebraic.cols(), std::numeric_limits<double>::quiet_NaN());
    if (mesh.error) {
        const Covariances squares = squares_of(*mesh.error, prepared.model.mesh);
        nodal.discretisation = traces(squares);
        nodal.covariance += squares;
    }
    nodal.shown = shown_nodes(prepared, result.pulls);
    nodal.placed = !place_is_uncertain(result);
    return {prepared.model.mesh, std::move(nodal), errors.data.held_out};
}

double interval_mm(const ErrorEstimate& estimate, double probability) {
    return radius_mm(estimate.covariance, normal_quantile(probability));
}

}  // namespace tissuewarp::registration
