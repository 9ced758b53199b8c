#include "tests/verification/study.hpp"

#include "tled/model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::verification {

Extrapolation richardson(double coarse, double middle, double fine, double ratio) {
    const double fall = (coarse - middle) / (middle - fine);
    if (!(fall > 1.0)) return {fine, std::numeric_limits<double>::quiet_NaN()};
    return {fine + (fine - middle) / (fall - 1.0), std::log(fall) / std::log(ratio)};
}

double mesh_error(double coarse_difference, double fine_difference, double ratio, double highest_order) {
    const double fall = coarse_difference / fine_difference;
    if (!(fall > 0.0)) {
        return std::max(std::abs(coarse_difference), std::abs(fine_difference)) / (ratio - 1.0);
    }
    const double order = std::clamp(std::log(fall) / std::log(ratio), 0.5, highest_order);
    return std::abs(fine_difference) / (std::pow(ratio, order) - 1.0);
}

double safety_factor(double observed_order, double highest_order) {
    return std::abs(observed_order - highest_order) <= 0.1 * highest_order ? 1.25 : 3.0;
}

bool expected_to_lock(const Problem& problem, Elements elements) {
    return elements == Elements::T4 && tled::suggested_element(problem.materials) != tled::Element::T4;
}

double highest_order(Elements elements) {
    return elements == Elements::Quadratic ? 4.0 : 2.0;
}

std::vector<Elements> elements_for(const Problem& problem) {
    std::vector<Elements> result{Elements::T4, Elements::AveragedPressure};
    if (problem.materials.size() == 1) result.push_back(Elements::Hexahedra);
    if (problem.plane_height) return result;
    const bool soft = tled::poisson_ratio(problem.materials.at(1)) < 0.4, cook = problem.name.starts_with("p4_cook");
    if (soft || cook) result.push_back(Elements::Quadratic);
    if (!soft || cook) result.push_back(Elements::QuadraticMixed);
    return result;
}

Comparison compare(const Quantity& quantity, const std::array<Eigen::VectorXd, 3>& values, double ratio,
                   double highest_order) {
    Comparison c{quantity.name, quantity.unit,      values[0],           values[1],
                 values[2],     quantity.reference, quantity.uncertainty};
    const Eigen::VectorXd coarse_change = c.middle - c.coarse, fine_change = c.fine - c.middle;
    c.largest_off = (c.fine - c.reference).cwiseAbs().maxCoeff();
    if (c.single()) {
        c.off = c.fine[0] - c.reference[0];
        c.uncertain = c.uncertainty[0];
        c.mesh_error = mesh_error(coarse_change[0], fine_change[0], ratio, highest_order);
        const Extrapolation limit = richardson(c.coarse[0], c.middle[0], c.fine[0], ratio);
        c.extrapolated = limit.value;
        c.order = limit.order;
        c.safety = safety_factor(c.order, highest_order);
        return c;
    }
    const double root = std::sqrt(static_cast<double>(c.fine.size()));
    c.off = (c.fine - c.reference).norm() / root;
    c.uncertain = c.uncertainty.norm() / root;
    c.mesh_error = mesh_error(coarse_change.norm(), fine_change.norm(), ratio, highest_order) / root;
    c.order = std::log(coarse_change.norm() / fine_change.norm()) / std::log(ratio);
    c.safety = safety_factor(c.order, highest_order);
    return c;
}

Study study(const Problem& problem, Elements elements) {
    return study(problem, elements, is_quadratic(elements) ? problem.quadratic_levels : problem.levels);
}

Study study(const Problem& problem, Elements elements, const std::array<int, 3>& levels) {
    Study result;
    const double ratio = static_cast<double>(levels[2]) / levels[1];
    std::vector<std::array<Eigen::VectorXd, 3>> values(problem.quantities.size());
    for (std::size_t k = 0; k < 3; ++k) {
        const Solution solution = solve(problem, elements, levels[k]);
        result.min_jacobian[k] = solution.min_jacobian;
        result.nodes[k] = static_cast<int>(solution.nodes().cols());
        result.iterations[k] = solution.iterations;
        for (std::size_t q = 0; q < values.size(); ++q) values[q][k] = problem.quantities[q].measure(solution);
    }
    for (std::size_t q = 0; q < values.size(); ++q) {
        result.comparisons.push_back(compare(problem.quantities[q], values[q], ratio, highest_order(elements)));
    }
    return result;
}

}  // namespace tissuewarp::verification
