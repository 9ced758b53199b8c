#include "registration/uncertainty.hpp"

#include "core/errors.hpp"
#include "registration/detail/ground.hpp"
#include "registration/detail/posterior.hpp"
#include "registration/detail/pull.hpp"
#include "tled/reference.hpp"

#include <cmath>
#include <string>

namespace tissuewarp::registration {

namespace {

using Covariances = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Where the data left more than this share of the prior's variance they say next to nothing.
constexpr double shown_below = 0.5;

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

/// Forces out of balance at the nodes, mN.
Eigen::Matrix3Xd residual(const PreparedModel& prepared, const LastPulls& pulls, const Eigen::Matrix3Xd& displacement) {
    Eigen::Matrix3Xd force = pulls.loads - tled::internal_force(prepared.rest, displacement);
    for (const auto* springs : {&pulls.data, &pulls.ground, &pulls.supports})
        for (const tled::Spring& spring : *springs)
            force.col(spring.node) += spring.stiffness * (spring.target - displacement.col(spring.node));
    return force;
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

/// q with P(‖e‖ ≤ q) = 95 % for Gaussian e of mean 0: ‖e‖² as a multiple of χ² of the same mean and variance
/// (Satterthwaite, Biometrics 2 (1946) 110), its quantile by Wilson & Hilferty, PNAS 17 (1931) 684.
double interval_of(const Eigen::Matrix3d& covariance) {
    constexpr double normal_quantile = 1.6448536269514722;
    const double mean = covariance.trace(), half_variance = covariance.squaredNorm();
    if (!(mean > 0)) return 0;
    const double freedom = mean * mean / half_variance, spread = 2 / (9 * freedom);
    return std::sqrt(mean) * std::pow(1 - spread + normal_quantile * std::sqrt(spread), 1.5);
}

ErrorEstimate estimate_of(const Eigen::Vector3d& algebraic, const Eigen::Vector3d& discretisation,
                          const Eigen::Matrix3d& covariance, double unexplained) {
    ErrorEstimate result;
    result.algebraic_mm = algebraic.norm();
    result.discretisation_mm = discretisation.norm();
    result.data_mm = std::sqrt(covariance.trace());
    const Eigen::Matrix3d all =
        covariance + algebraic * algebraic.transpose() + discretisation * discretisation.transpose();
    result.deviation_mm = std::sqrt(all.trace());
    result.interval_mm = interval_of(all);
    result.shown = unexplained < shown_below;
    return result;
}

}  // namespace

Uncertainty::Uncertainty(meshing::TetMesh mesh, Eigen::Matrix3Xd algebraic, Eigen::Matrix3Xd discretisation,
                         Covariances covariance, Eigen::VectorXd unexplained)
    : mesh_(std::move(mesh)),
      locator_(mesh_),
      algebraic_(std::move(algebraic)),
      discretisation_(std::move(discretisation)),
      covariance_(std::move(covariance)),
      unexplained_(std::move(unexplained)) {}

std::vector<ErrorEstimate> Uncertainty::at_nodes() const {
    std::vector<ErrorEstimate> result;
    for (Eigen::Index n = 0; n < unexplained_.size(); ++n)
        result.push_back(
            estimate_of(algebraic_.col(n), discretisation_.col(n), matrix_of(covariance_.col(n)), unexplained_[n]));
    return result;
}

std::vector<std::optional<ErrorEstimate>> Uncertainty::at(const Eigen::Matrix3Xd& points) const {
    std::vector<std::optional<ErrorEstimate>> result;
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
        const auto place = detail::locate_near(locator_, points.col(p));
        result.emplace_back();
        if (!place) continue;
        const auto here = [&](const Eigen::MatrixXd& nodal) { return meshing::interpolate(mesh_, nodal, *place); };
        result.back() = estimate_of(here(algebraic_), here(discretisation_), matrix_of(here(covariance_)),
                                    here(unexplained_.transpose())[0]);
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

Uncertainty uncertainty(const PreparedModel& prepared, const UpdateResult& result, const UncertaintyOptions& options,
                        Observer& observer) {
    require_related(prepared, result);
    const LastPulls& pulls = result.pulls;
    detail::WeighedSprings prior{pulls.supports, pulls.ground, pulls.energy, pulls.free_placement}, all = prior;
    append(all.data, pulls.data);
    if (prior.ground.empty())
        prior.ground = detail::ground_springs(prepared, pulls.energy,
                                              [](const InterfaceNode&) { return TissuePrior().free_motion_mm; });

    observer.checkpoint("error estimate", 0.0);
    const detail::Posterior posterior(prepared, all);
    const Covariances covariance = covariances_of(posterior.samples(options.samples, options.seed));
    observer.checkpoint("error estimate", 0.4);
    const Covariances before =
        covariances_of(detail::Posterior(prepared, prior).samples(options.samples, options.seed));
    observer.checkpoint("error estimate", 0.7);
    const Eigen::Matrix3Xd displacement = displacement_under_pulls(result);
    const Eigen::Matrix3Xd algebraic = posterior.stiffness().solve(residual(prepared, pulls, displacement));
    const Eigen::Matrix3Xd discretisation = Eigen::Matrix3Xd::Zero(3, displacement.cols());
    observer.checkpoint("error estimate", 1.0);
    return {prepared.model.mesh, algebraic, discretisation, covariance,
            covariance.topRows<3>().colwise().sum().cwiseQuotient(before.topRows<3>().colwise().sum()).transpose()};
}

}  // namespace tissuewarp::registration
