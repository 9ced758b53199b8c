#include "registration/uncertainty.hpp"

#include "core/errors.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/springs/pull.hpp"
#include "registration/uncertainty/data_uncertainty.hpp"
#include "tled/error/lifted_residual.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

namespace tissuewarp::registration {

namespace {

using Covariances = Eigen::Matrix<double, 6, Eigen::Dynamic>;

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
    return tled::nodal_conditions(conditions, prepared.rest.node_count);
}

Eigen::Matrix3d matrix_of(const Eigen::Matrix<double, 6, 1>& c) {
    return (Eigen::Matrix3d() << c[0], c[3], c[4], c[3], c[1], c[5], c[4], c[5], c[2]).finished();
}

/// Points of a part of the surface alone: where an organ of smooth shape lies may be told wrong, by more than any
/// estimate about the place that was found says.
bool place_is_uncertain(const UpdateResult& result) {
    return result.pulls.free_placement && result.surface && !result.points && !result.curves;
}

/// x with Φ(x) = probability, by Newton's method.
double normal_quantile(double probability) {
    double x = 0;
    for (int iteration = 0; iteration < 30; ++iteration)
        x -= (0.5 * std::erfc(-x / std::sqrt(2.0)) - probability) * std::sqrt(2 * EIGEN_PI) * std::exp(0.5 * x * x);
    return x;
}

/// What the data leave open, and the stiffness with their springs.
struct OpenParts {
    detail::DataUncertainty data;
    tled::RestStiffness stiffness;
};

OpenParts open_here(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options) {
    detail::Posteriors posteriors = detail::posteriors_of(prepared, result.pulls);
    detail::DataUncertainty data =
        detail::data_uncertainty(prepared, posteriors, result.deformation.displacement, options.samples, options.seed);
    return {std::move(data), std::move(posteriors.seen).stiffness()};
}

/// On the mesh of the size that the estimate was calibrated with: a factor of a large one would take minutes and say
/// nothing else, since what data leave open varies smoothly.
OpenParts open_by_twin(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options,
                       Observer& observer) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const detail::CoarseTwin twin = detail::coarse_twin(prepared, result, observer);
    const meshing::TetMesh& mesh = twin.prepared.model.mesh;
    detail::DataUncertainty data =
        detail::data_uncertainty(twin.prepared, detail::posteriors_of(twin.prepared, twin.pulls), twin.displacement,
                                 options.samples, options.seed);
    data.covariance = detail::carried(mesh, data.covariance, nodes);
    data.unexplained = detail::carried(mesh, data.unexplained.transpose(), nodes).transpose();
    return {std::move(data), {prepared.rest, conditions_of(prepared, result.pulls), prepared.stiffness}};
}

ErrorEstimate estimate_of(const Eigen::Vector3d& algebraic, const std::optional<Eigen::Vector3d>& discretisation,
                          const Eigen::Matrix3d& covariance, double unexplained) {
    ErrorEstimate result;
    result.algebraic_mm = algebraic.norm();
    result.discretisation_mm = discretisation ? discretisation->norm() : std::numeric_limits<double>::quiet_NaN();
    result.data_mm = std::sqrt(covariance.trace());
    result.covariance = covariance + algebraic * algebraic.transpose();
    if (discretisation) result.covariance += *discretisation * discretisation->transpose();
    result.deviation_mm = std::sqrt(result.covariance.trace());
    result.interval_mm = interval_mm(result, 0.95);
    result.shown = unexplained < detail::error_model.shown_below;
    return result;
}

}  // namespace

Uncertainty::Uncertainty(meshing::TetMesh mesh, Eigen::Matrix3Xd algebraic,
                         std::optional<tled::DiscretisationError> discretisation, Covariances covariance,
                         Eigen::VectorXd unexplained, std::optional<ExpectedError> expected)
    : mesh_(std::move(mesh)),
      locator_(mesh_),
      algebraic_(std::move(algebraic)),
      discretisation_(std::move(discretisation)),
      covariance_(std::move(covariance)),
      unexplained_(std::move(unexplained)),
      expected_(expected) {}

std::vector<ErrorEstimate> Uncertainty::at_nodes() const {
    std::vector<ErrorEstimate> result;
    for (Eigen::Index n = 0; n < unexplained_.size(); ++n) {
        std::optional<Eigen::Vector3d> of_mesh;
        if (discretisation_) of_mesh = discretisation_->corner.col(n);
        result.push_back(estimate_of(algebraic_.col(n), of_mesh, matrix_of(covariance_.col(n)), unexplained_[n]));
    }
    return result;
}

std::vector<std::optional<ErrorEstimate>> Uncertainty::at(const Eigen::Matrix3Xd& points) const {
    std::vector<std::optional<ErrorEstimate>> result;
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
        const auto place = detail::locate_near(locator_, points.col(p));
        result.emplace_back();
        if (!place) continue;
        const auto here = [&](const Eigen::MatrixXd& nodal) { return meshing::interpolate(mesh_, nodal, *place); };
        std::optional<Eigen::Vector3d> of_mesh;
        if (discretisation_) of_mesh = discretisation_->at(mesh_, place->tet, place->barycentric);
        result.back() =
            estimate_of(here(algebraic_), of_mesh, matrix_of(here(covariance_)), here(unexplained_.transpose())[0]);
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
        if (!here.shown) sum.unseen_share += share[n];
        if (here.interval_mm <= sum.worst_interval_mm) continue;
        sum.worst_interval_mm = here.interval_mm;
        sum.worst_place = mesh.nodes.col(n);
    }
    for (double* squared : {&sum.algebraic_mm, &sum.discretisation_mm, &sum.data_mm, &sum.deviation_mm})
        *squared = std::sqrt(*squared);
    return sum;
}

std::optional<Doubt> doubt_of_solver(const UncertaintySummary& summary, double tolerance_mm) {
    if (summary.algebraic_mm <= tolerance_mm) return std::nullopt;
    char text[160];
    std::snprintf(text, sizeof text,
                  "the solver stopped %.2g mm (root mean square) from equilibrium, where %.2g mm were asked for",
                  summary.algebraic_mm, tolerance_mm);
    return Doubt{"solver.short", summary.algebraic_mm, tolerance_mm, text};
}

std::vector<Doubt> doubts_of(const Uncertainty& uncertainty, double tolerance_mm) {
    std::vector<Doubt> doubts;
    if (auto doubt = doubt_of_solver(summarise(uncertainty), tolerance_mm)) doubts.push_back(std::move(*doubt));
    if (!uncertainty.expected()) return doubts;
    if (auto doubt = doubt_of_data(*uncertainty.expected())) doubts.push_back(std::move(*doubt));
    return doubts;
}

std::optional<Doubt> doubt_of_accuracy(const UncertaintySummary& summary, double accuracy_mm) {
    if (summary.interval_mm <= accuracy_mm) return std::nullopt;
    char text[256];
    std::snprintf(text, sizeof text,
                  "%.3g mm were asked for, and errors are within %.3g mm with a probability of 95 %% (1 σ: %.3g mm, of "
                  "which the data leave %.3g mm and the mesh %.3g mm); %s",
                  accuracy_mm, summary.interval_mm, summary.deviation_mm, summary.data_mm, summary.discretisation_mm,
                  summary.data_mm > summary.discretisation_mm ? "more or better data would help, a finer mesh would not"
                                                              : "a finer mesh would help");
    return Doubt{"accuracy.not_sure", summary.interval_mm, accuracy_mm, text};
}

Uncertainty uncertainty(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options,
                        Observer& observer) {
    require_related(prepared, result);
    observer.checkpoint("error estimate", 0.0);
    const OpenParts open = prepared.stiffness.is_large() ? open_by_twin(prepared, result, options, observer)
                                                         : open_here(prepared, result, options);
    observer.checkpoint("error estimate", 0.6);
    const Eigen::Matrix3Xd displacement = displacement_under_pulls(result);
    const tled::NodalConditions conditions = conditions_of(prepared, result.pulls);
    const Eigen::Matrix3Xd algebraic = tled::lifted_residual(prepared.rest, open.stiffness, conditions, displacement);
    observer.checkpoint("error estimate", 0.7);
    const tled::DiscretisationEstimate mesh =
        tled::discretisation_error(prepared.model, open.stiffness, conditions, displacement);
    if (!mesh.error) observer.note("no estimate of the error of the mesh: " + mesh.reason);
    Eigen::VectorXd unexplained = open.data.unexplained;
    if (place_is_uncertain(result)) unexplained.setConstant(2 * detail::error_model.shown_below);
    observer.checkpoint("error estimate", 1.0);
    return {prepared.model.mesh, algebraic, mesh.error, open.data.covariance, unexplained, open.data.expected};
}

// ‖e‖² over its mean is a multiple of χ² (Satterthwaite, Biometrics 2 (1946) 110) whose scale is itself known from few
// numbers: F. Its quantile is that of a normal ratio of cube roots (Paulson, Ann Math Statist 13 (1942) 233).
double interval_mm(const ErrorEstimate& estimate, double probability) {
    const double mean = estimate.covariance.trace();
    if (!(mean > 0)) return 0;
    const double freedom = mean * mean / estimate.covariance.squaredNorm();
    const double a = 2 / (9 * freedom), b = 2 / (9 * freedom_of_size), z = normal_quantile(probability);
    // ((1 − b) y − (1 − a))² = z² (b y² + a), the root on z's side
    const double square = (1 - b) * (1 - b) - z * z * b, middle = (1 - a) * (1 - b),
                 rest = (1 - a) * (1 - a) - z * z * a;
    const double root = std::sqrt(std::max(0.0, middle * middle - square * rest));
    const double y = std::max(0.0, (middle + (z < 0 ? -root : root)) / square);
    return std::sqrt(mean * (freedom_of_size - 2) / freedom_of_size * y * y * y);
}

}  // namespace tissuewarp::registration
