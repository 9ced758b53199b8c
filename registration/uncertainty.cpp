#include "registration/uncertainty.hpp"

#include "core/errors.hpp"
#include "registration/detail/expected_error.hpp"
#include "registration/detail/ground.hpp"
#include "registration/detail/posterior.hpp"
#include "registration/detail/pull.hpp"
#include "registration/detail/rigid_part.hpp"
#include "registration/detail/unknown_loads.hpp"
#include "registration/detail/white_noise.hpp"
#include "tled/lifted_residual.hpp"
#include "tled/reference.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

namespace tissuewarp::registration {

namespace {

using Covariances = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Where the data left more than this share of the bending that unknown loads make they say next to nothing.
constexpr double shown_below = 0.9;
/// Of random phantoms (docs/accuracy-time.md, "Does the interval hold?"). The noise of a datum is far less than its
/// pull admits, since neighbours share what they say. The size of the loads is known as a variance is from `freedom`
/// numbers.
constexpr double noise_share = 0.05, least_energy = 0.2, freedom_of_size = 6;

void append(std::vector<tled::Spring>& springs, const std::vector<tled::Spring>& others) {
    springs.insert(springs.end(), others.begin(), others.end());
}

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
    for (const auto* springs : {&pulls.data, &pulls.holds, &pulls.ground, &pulls.supports})
        append(conditions.springs, *springs);
    conditions.external_force = pulls.loads;
    return tled::nodal_conditions(conditions, prepared.rest.node_count);
}

/// xx, yy, zz, xy, xz, yz of every node's displacement over the samples (3N × k of mean 0).
Covariances covariances_of(const Eigen::MatrixXd& samples) {
    Covariances result(6, samples.rows() / 3);
    for (Eigen::Index n = 0; n < result.cols(); ++n) {
        const Eigen::Matrix<double, 3, Eigen::Dynamic> drawn = samples.middleRows<3>(3 * n);
        const Eigen::Matrix3d c = drawn * drawn.transpose() / double(samples.cols());
        result.col(n) << c(0, 0), c(1, 1), c(2, 2), c(0, 1), c(0, 2), c(1, 2);
    }
    return result;
}

Eigen::Matrix3d matrix_of(const Eigen::Matrix<double, 6, 1>& c) {
    return (Eigen::Matrix3d() << c[0], c[3], c[4], c[3], c[1], c[5], c[4], c[5], c[2]).finished();
}

/// Forces that the noise of the data exerts through its springs, 3N × count: of covariance energy · K.
Eigen::MatrixXd noise_forces(const detail::WeighedSprings& springs, Eigen::Index rows, int count, std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    Eigen::MatrixXd forces = Eigen::MatrixXd::Zero(rows, count);
    for (const tled::Spring& spring : springs.data) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spring.stiffness);
        const Eigen::Matrix3d root =
            axes.eigenvectors() * (springs.energy * axes.eigenvalues().cwiseMax(0)).cwiseSqrt().asDiagonal();
        forces.middleRows<3>(3 * spring.node) += root * detail::white_noise(3, count, generator);
    }
    return forces;
}

/// Square of how large the unknown loads are, over those drawn: as large as the tissue was seen to strain, by strain
/// energy, where it would be seen to move as `visible` (3N × k, mm) under those drawn.
double load_size(const PreparedModel& prepared, const UpdateResult& result, const Eigen::MatrixXd& visible) {
    const Eigen::Matrix3Xd& found = result.deformation.displacement;
    const auto stiffness = tled::tangent_stiffness(prepared.rest, Eigen::Matrix3Xd::Zero(3, found.cols()));
    const double drawn = 0.5 * visible.cwiseProduct(stiffness * visible).sum() / double(visible.cols());
    return (tled::elastic_energy(prepared.rest, found) + least_energy * result.pulls.energy) / drawn;
}

/// What part of the variance of bending under the loads drawn the data leave, at each node: of all motion left, or with
/// motions of the organ as a whole left out, which labels may leave open of a round one; the lesser of both.
Eigen::VectorXd unexplained_share(const Eigen::Matrix3Xd& nodes, const Eigen::MatrixXd& hidden,
                                  const Eigen::MatrixXd& free) {
    const Eigen::MatrixXd motions = detail::rigid_motions(nodes);
    const Eigen::LDLT<Eigen::MatrixXd> squares(motions.transpose() * motions);
    const auto variance = [](const Eigen::MatrixXd& moved) {
        return Eigen::VectorXd(covariances_of(moved).topRows<3>().colwise().sum());
    };
    const auto bending = [&](const Eigen::MatrixXd& moved) {
        return Eigen::MatrixXd(moved - motions * squares.solve(motions.transpose() * moved));
    };
    return variance(hidden).cwiseMin(variance(bending(hidden))).cwiseQuotient(variance(bending(free)));
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
    result.shown = unexplained < shown_below;
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

std::string doubt_of_solver(const UncertaintySummary& summary, double tolerance_mm) {
    if (summary.algebraic_mm <= tolerance_mm) return {};
    char text[160];
    std::snprintf(text, sizeof text,
                  "the solver stopped %.2g mm (root mean square) from equilibrium, where %.2g mm were asked for",
                  summary.algebraic_mm, tolerance_mm);
    return text;
}

std::vector<std::string> doubts_of(const Uncertainty& uncertainty, double tolerance_mm) {
    std::vector<std::string> reasons{doubt_of_solver(summarise(uncertainty), tolerance_mm)};
    if (uncertainty.expected()) reasons.push_back(doubt_of_data(*uncertainty.expected()));
    std::erase(reasons, "");
    return reasons;
}

std::string doubt_of_accuracy(const UncertaintySummary& summary, double accuracy_mm) {
    if (summary.interval_mm <= accuracy_mm) return {};
    char text[256];
    std::snprintf(text, sizeof text,
                  "%.3g mm were asked for, and errors are within %.3g mm with a probability of 95 %% (1 σ: %.3g mm, of "
                  "which the data leave %.3g mm and the mesh %.3g mm); %s",
                  accuracy_mm, summary.interval_mm, summary.deviation_mm, summary.data_mm, summary.discretisation_mm,
                  summary.data_mm > summary.discretisation_mm ? "more or better data would help, a finer mesh would not"
                                                              : "a finer mesh would help");
    return text;
}

Uncertainty uncertainty(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options,
                        Observer& observer) {
    require_related(prepared, result);
    const LastPulls& pulls = result.pulls;
    detail::WeighedSprings unseen{pulls.supports, pulls.ground, pulls.energy, pulls.free_placement};
    const bool points_alone = !unseen.ground.empty();
    if (!points_alone) {  // labels show where the organ lies, however it turned
        unseen.ground = detail::ground_springs(prepared, pulls.energy,
                                               [](const InterfaceNode&) { return TissuePrior().free_motion_mm; });
        unseen.free_placement = true;
    }
    detail::WeighedSprings seen = unseen;
    append(seen.data, pulls.data);

    observer.checkpoint("error estimate", 0.0);
    const auto [posterior, prior] = detail::Posterior::both(prepared, seen, unseen);
    observer.checkpoint("error estimate", 0.4);
    const Eigen::MatrixXd loads = detail::unknown_loads(prepared, options.samples, options.seed);
    const Eigen::MatrixXd hidden = posterior.inverse(loads), free = prior.inverse(loads);
    observer.checkpoint("error estimate", 0.6);
    const Eigen::MatrixXd noise =
        posterior.inverse(noise_forces(seen, loads.rows(), options.samples, options.seed + 1));
    const Covariances covariance =
        load_size(prepared, result, free - hidden) * covariances_of(hidden) + noise_share * covariances_of(noise);
    Eigen::VectorXd unexplained = unexplained_share(prepared.model.mesh.nodes, hidden, free);
    if (place_is_uncertain(result)) unexplained.setConstant(2 * shown_below);
    const Eigen::Matrix3Xd displacement = displacement_under_pulls(result);
    const tled::NodalConditions conditions = conditions_of(prepared, pulls);
    const Eigen::Matrix3Xd algebraic =
        tled::lifted_residual(prepared.rest, posterior.stiffness(), conditions, displacement);
    observer.checkpoint("error estimate", 0.7);
    const tled::DiscretisationEstimate mesh =
        tled::discretisation_error(prepared.model, posterior.stiffness(), conditions, displacement);
    if (!mesh.error) observer.note("no estimate of the error of the mesh: " + mesh.reason);
    std::optional<ExpectedError> expected;
    if (points_alone) expected = detail::expected_error(prepared.model.mesh.nodes, posterior);
    observer.checkpoint("error estimate", 1.0);
    return {prepared.model.mesh, algebraic, mesh.error, covariance, unexplained, expected};
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
