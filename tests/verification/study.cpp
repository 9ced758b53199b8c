#include "tests/verification/study.hpp"

#include "tests/verification/limit.hpp"
#include "tled/model.hpp"

#include <cmath>

namespace tissuewarp::verification {

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
    if (problem.plane_height) return result;
    const bool soft = tled::poisson_ratio(problem.materials.at(1)) < 0.4, cook = problem.name.starts_with("p4_cook");
    if (soft || cook) result.push_back(Elements::Quadratic);
    if (!soft || cook) result.push_back(Elements::QuadraticMixed);
    return result;
}

Comparison compare(const Quantity& quantity, const std::array<Eigen::VectorXd, 4>& values,
                   const std::array<int, 4>& levels, double highest_order) {
    Comparison c{quantity.name, quantity.unit, values, quantity.reference, quantity.uncertainty};
    const Limit limit = limit_of({levels.begin(), levels.end()}, {values.begin(), values.end()}, highest_order);
    const Eigen::VectorXd off = c.finest() - c.reference;
    const double root = std::sqrt(static_cast<double>(off.size()));
    c.off = c.single() ? off[0] : off.norm() / root;
    c.largest_off = off.cwiseAbs().maxCoeff();
    c.uncertain = c.uncertainty.norm() / root;
    c.distance = (c.finest() - limit.value).norm() / root;
    c.limit_error = limit.standard_error;
    c.order = limit.order;
    c.safety = safety_factor(c.order, highest_order);
    c.extrapolated = limit.value[0];
    return c;
}

Study study(const Problem& problem, Elements elements) {
    return study(problem, elements, is_quadratic(elements) ? problem.quadratic_levels : problem.levels);
}

Study study(const Problem& problem, Elements elements, const std::array<int, 4>& levels) {
    Study result;
    std::vector<std::array<Eigen::VectorXd, 4>> values(problem.quantities.size());
    for (std::size_t k = 0; k < levels.size(); ++k) {
        const Solution solution = solve(problem, elements, levels[k]);
        result.min_jacobian[k] = solution.min_jacobian;
        result.nodes[k] = static_cast<int>(solution.nodes().cols());
        result.iterations[k] = solution.iterations;
        for (std::size_t q = 0; q < values.size(); ++q) values[q][k] = problem.quantities[q].measure(solution);
    }
    for (std::size_t q = 0; q < values.size(); ++q) {
        result.comparisons.push_back(compare(problem.quantities[q], values[q], levels, highest_order(elements)));
    }
    return result;
}

}  // namespace tissuewarp::verification
