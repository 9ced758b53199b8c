#pragma once
/// Three meshes, their order of convergence, and the comparison with the reference.

#include "tests/verification/solution.hpp"

#include <array>
#include <cmath>
#include <vector>

namespace tissuewarp::verification {

/// Richardson extrapolation of three values on meshes of constant refinement ratio, coarse to fine.
struct Extrapolation {
    double value = 0;
    double order = 0;  ///< NaN where the differences do not fall monotonically
};
Extrapolation richardson(double coarse, double middle, double fine, double ratio);

/// The distance from the fine mesh to the limit that the differences of three meshes show: fine / (ratio^p − 1), where
/// `fine` is the difference between the two finest and p the observed order log(coarse/fine) / log(ratio), but not
/// below ½ nor above what the element can reach. Both differences are norms, or signed for one number: where those
/// change sign the result is the larger of the two / (ratio − 1).
double mesh_error(double coarse_difference, double fine_difference, double ratio, double highest_order);

/// Factor of safety of the grid convergence index on mesh_error: 1.25 where three meshes show the element's order
/// within a tenth, 3 otherwise. Oberkampf & Roy, Verification and Validation in Scientific Computing (2010), table 8.1,
/// whose orders are bounded as those of mesh_error; Roache, J. Fluids Eng. 116 (1994) 405.
double safety_factor(double observed_order, double highest_order);

/// Is this plain linear tetrahedra beyond the Poisson's ratio up to which tled::suggested_element chooses them? Misses
/// are expected there and counted apart.
bool expected_to_lock(const Problem& problem, Elements elements);

/// Of forces and energies: 2 for linear elements, 4 for quadratic ones with the pressure in their points, 2 for those
/// with averages of J, which are projections by a lumped mass matrix: their error of second order in h, times 1/κ,
/// vanishes only as ν → ½.
double highest_order(Elements elements);

/// T4, averaged pressure and one-point hexahedra, these without the stiff ball, between whose shells and the surface
/// hexahedra fold at the rims; quadratic tetrahedra, with averaged pressure from ν = 0.4 on, both for Cook's membrane,
/// none for contact: at corners of a flat face under uniform pressure their consistent nodal forces are zero, so that
/// no nodal contact set can be told from them.
std::vector<Elements> elements_for(const Problem& problem);

/// One quantity of one problem on three meshes. Many numbers are compared in the root mean square.
struct Comparison {
    std::string quantity, unit;
    Eigen::VectorXd coarse, middle, fine, reference, uncertainty;
    double off = 0;           ///< fine − reference of one number, otherwise its root mean square
    double uncertain = 0;     ///< of the reference, likewise
    double mesh_error = 0;    ///< of the fine mesh, from the differences between meshes alone
    double order = 0;         ///< observed; NaN where the differences change sign
    double safety = 3;        ///< safety_factor
    double extrapolated = 0;  ///< one number only
    double largest_off = 0;   ///< of any entry

    [[nodiscard]] bool single() const { return fine.size() == 1; }
    /// |off| − (uncertainty + mesh error): met where it is not positive.
    [[nodiscard]] double excess() const { return std::abs(off) - uncertain - mesh_error; }
    [[nodiscard]] bool met() const { return excess() <= 0.0; }
    /// The weaker bar of the grid convergence index: uncertainty + safety factor · mesh error.
    [[nodiscard]] bool met_within_index() const { return std::abs(off) <= uncertain + safety * mesh_error; }
};
Comparison compare(const Quantity& quantity, const std::array<Eigen::VectorXd, 3>& values, double ratio,
                   double highest_order);

struct Study {
    std::array<double, 3> min_jacobian{};
    std::array<int, 3> nodes{}, iterations{};
    std::vector<Comparison> comparisons;
};

/// Solves the problem on its three levels, or on `levels` when given.
Study study(const Problem& problem, Elements elements);
Study study(const Problem& problem, Elements elements, const std::array<int, 3>& levels);

}  // namespace tissuewarp::verification
