#pragma once
/// Four meshes, the limit they show, and the comparison with the reference.

#include "tests/verification/solution.hpp"

#include <array>
#include <cmath>
#include <string>
#include <vector>

namespace tissuewarp::verification {

/// Factor of safety of the grid convergence index on the distance to the limit: 1.25 where the meshes show the
/// element's order within a tenth, 3 otherwise. Oberkampf & Roy, Verification and Validation in Scientific Computing
/// (2010), table 8.1, whose orders are bounded as those of limit_of; Roache, J. Fluids Eng. 116 (1994) 405.
double safety_factor(double observed_order, double highest_order);

/// Is this plain linear tetrahedra beyond the Poisson's ratio up to which tled::suggested_element chooses them? Misses
/// are expected there and counted apart.
bool expected_to_lock(const Problem& problem, Elements elements);

/// Of forces and energies: 2 for linear elements, 4 for quadratic ones with the pressure in their points, 2 for those
/// with averages of J, which are projections by a lumped mass matrix: their error of second order in h, times 1/κ,
/// vanishes only as ν → ½.
double highest_order(Elements elements);

/// T4 and averaged pressure; quadratic tetrahedra, with averaged pressure from ν = 0.4 on, both for Cook's membrane,
/// none for contact: at corners of a flat face under uniform pressure their consistent nodal forces are zero, so that
/// no nodal contact set can be told from them.
std::vector<Elements> elements_for(const Problem& problem);

/// One quantity of one problem on four meshes, coarse to fine. Many numbers are compared in the root mean square.
struct Comparison {
    std::string quantity, unit;
    std::array<Eigen::VectorXd, 4> values;
    Eigen::VectorXd reference, uncertainty;
    double off = 0;           ///< finest − reference of one number, otherwise its root mean square
    double largest_off = 0;   ///< of any entry
    double uncertain = 0;     ///< of the reference, as `off`
    double distance = 0;      ///< from the finest mesh to the limit of all, as `off` without sign
    double limit_error = 0;   ///< standard error of that limit
    double order = 0;         ///< observed; NaN where there is none
    double safety = 3;        ///< safety_factor
    double extrapolated = 0;  ///< the limit of one number

    [[nodiscard]] const Eigen::VectorXd& finest() const { return values.back(); }
    [[nodiscard]] bool single() const { return finest().size() == 1; }
    /// Of the finest mesh, from the meshes alone: distance to the limit and how well that is known.
    [[nodiscard]] double mesh_error() const { return distance + limit_error; }
    /// |off| − (uncertainty + mesh error): met where it is not positive.
    [[nodiscard]] double excess() const { return std::abs(off) - uncertain - mesh_error(); }
    [[nodiscard]] bool met() const { return excess() <= 0.0; }
    /// The same with the factor of safety on the distance.
    [[nodiscard]] double index_error() const { return safety * distance + limit_error; }
    /// The weaker bar of the grid convergence index.
    [[nodiscard]] bool met_within_index() const { return std::abs(off) <= uncertain + index_error(); }
};
Comparison compare(const Quantity& quantity, const std::array<Eigen::VectorXd, 4>& values,
                   const std::array<int, 4>& levels, double highest_order);

struct Study {
    std::array<double, 4> min_jacobian{};
    std::array<int, 4> nodes{}, iterations{};
    std::vector<Comparison> comparisons;
};

/// Solves the problem on its four levels, or on `levels` when given.
Study study(const Problem& problem, Elements elements);
Study study(const Problem& problem, Elements elements, const std::array<int, 4>& levels);

}  // namespace tissuewarp::verification
