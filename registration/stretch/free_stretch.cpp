#include "registration/stretch/free_stretch.hpp"

#include "registration/evaluation/percentile.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/pose/label_distance.hpp"
#include "registration/pose/label_rivals.hpp"

#include <Eigen/Eigenvalues>
#include <nlopt.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

constexpr FreeStretchOptions rules;
constexpr std::size_t parameters = 9;
using Parameters = std::array<double, parameters>;  // shift, then the stretch's logarithm times the radius; mm

Eigen::Matrix3d exponential(const Eigen::Matrix3d& symmetric) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(symmetric);
    const Eigen::Vector3d stretches = parts.eigenvalues().array().exp();
    return parts.eigenvectors() * stretches.asDiagonal() * parts.eigenvectors().transpose();
}

/// Stretches about the middle of the moving boundary, and shifts.
struct StretchSpace {
    Eigen::Vector3d centre;
    double radius = 1;

    [[nodiscard]] Eigen::Affine3d stretch(const Parameters& x) const {
        Eigen::Matrix3d logarithm;
        logarithm << x[3], x[6], x[7], x[6], x[4], x[8], x[7], x[8], x[5];
        return Eigen::Translation3d(centre) * Eigen::Affine3d(exponential(logarithm / radius)) *
               Eigen::Translation3d(-centre);
    }
    [[nodiscard]] static Eigen::Vector3d shift(const Parameters& x) { return {x[0], x[1], x[2]}; }
};

/// The organ is turned, then stretched along the axes of the fixed frame.
struct Search {
    const LabelDistance& cost;
    Eigen::Isometry3d turned;
    StretchSpace space;

    [[nodiscard]] double operator()(const Parameters& x) const {
        const Eigen::Affine3d map =
            Eigen::Translation3d(StretchSpace::shift(x)) * space.stretch(x) * Eigen::Affine3d(turned.matrix());
        return cost(map, rules.trim_mm, 1);
    }
};

/// What brings the extents of both boundaries together, axis by axis.
Parameters from_extents(const StretchSpace& space, const Eigen::Matrix3Xd& moving, const Eigen::Matrix3Xd& fixed,
                        double most) {
    Parameters x{};
    for (int axis = 0; axis < 3; ++axis) {
        const auto extent = [&](const Eigen::Matrix3Xd& points) {
            const Eigen::VectorXd values = points.row(axis).transpose();
            std::vector<double> all(values.begin(), values.end());
            const double least = percentile(all, rules.extent_percentile);
            return std::array{least, percentile(all, 100 - rules.extent_percentile)};
        };
        const auto from = extent(moving), to = extent(fixed);
        const double logarithm = std::clamp(std::log((to[1] - to[0]) / (from[1] - from[0])), -most, most);
        const double middle =
            space.centre[axis] + std::exp(logarithm) * (0.5 * (from[0] + from[1]) - space.centre[axis]);
        x[static_cast<std::size_t>(axis)] = 0.5 * (to[0] + to[1]) - middle;
        x[static_cast<std::size_t>(axis) + 3] = logarithm * space.radius;
    }
    return x;
}

Parameters minimise(const Search& search, const Parameters& start, double most) {
    nlopt::opt optimiser(nlopt::LN_BOBYQA, parameters);
    Search copy = search;  // NLopt takes a pointer to mutable data
    optimiser.set_min_objective(
        [](unsigned count, const double* x, double*, void* data) {
            Parameters at{};
            std::copy(x, x + count, at.begin());
            return (*static_cast<const Search*>(data))(at);
        },
        &copy);
    std::vector<double> lower(parameters, -HUGE_VAL), upper(parameters, HUGE_VAL);
    std::fill(lower.begin() + 3, lower.end(), -most * search.space.radius);
    std::fill(upper.begin() + 3, upper.end(), most * search.space.radius);
    optimiser.set_lower_bounds(lower);
    optimiser.set_upper_bounds(upper);
    optimiser.set_initial_step(std::min(rules.first_step_mm, 0.5 * most * search.space.radius));
    optimiser.set_xtol_abs(rules.tolerance_mm);
    optimiser.set_maxeval(rules.evaluations);
    std::vector<double> x(start.begin(), start.end());
    double cost = 0;
    try {
        optimiser.optimize(x, cost);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x: as good as this cost can be resolved.
    }
    Parameters found{};
    std::copy(x.begin(), x.end(), found.begin());
    return found;
}

FreeStretch search_from(const LabelDistance& cost, const Eigen::Isometry3d& turned, double most) {
    const Eigen::Matrix3Xd moving = turned * cost.forward.points();
    const Eigen::Vector3d centre = moving.rowwise().mean();
    const StretchSpace space{centre, std::sqrt((moving.colwise() - centre).colwise().squaredNorm().mean())};
    const Search search{cost, turned, space};
    const Parameters found = minimise(search, from_extents(space, moving, cost.backward.points(), most), most);
    // shift · stretch · turned = (shift · turned) · (turned⁻¹ · stretch · turned)
    FreeStretch result;
    result.placement = Eigen::Translation3d(StretchSpace::shift(found)) * turned;
    const Eigen::Affine3d turn(turned.matrix());
    result.stretch = turn.inverse() * space.stretch(found) * turn;
    result.mean_distance_mm = search(found);
    return result;
}

}  // namespace

FreeStretch find_free_stretch(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels, double most,
                              const AlignmentOptions* alignment, Observer& observer) {
    LabelBoundaries moving(moving_labels), fixed(fixed_labels);
    const LabelDistance cost(moving, fixed, rules.samples);
    const FreeStretch straight = search_from(cost, Eigen::Isometry3d::Identity(), most);
    observer.checkpoint("free stretch", 0.5);
    if (!alignment || straight.mean_distance_mm < label_rival_options.look_above_mm) return straight;
    const Alignment aligned = align_labels(moving, fixed, *alignment, observer);
    const FreeStretch turned = search_from(cost, aligned.placement, most);
    return is_better_rival(turned.mean_distance_mm, straight.mean_distance_mm) ? turned : straight;
}

}  // namespace tissuewarp::registration::detail
