#pragma once
/// The value on infinitely fine meshes that the values on several meshes show, and how well they show it.

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::verification {

/// Least squares of u(h) = u₀ + α hᵖ, with one order p for all numbers of a quantity.
struct Limit {
    Eigen::VectorXd value;      ///< u₀
    double order = 0;           ///< of the best fit, before it is clamped; NaN where no order between 0 and twice the
                                ///< highest one fits best
    double standard_error = 0;  ///< of u₀, root mean square over its numbers
};

/// Fits four or more meshes of one family, all with the same weight; `cells` (along any length) grow from one to the
/// next. The order of the best fit is clamped to ½ … `highest_order`, to which u₀ and α belong. The standard error is
/// that of nonlinear least squares, the root of σ² (JᵀJ)⁻¹ with σ² the sum of squares over the degrees of freedom and
/// J the derivatives by u₀, α and, where it is not clamped, p: it grows where the values do not follow one power of h,
/// and where the meshes say little about p. After L. Eça & M. Hoekstra, J. Comput. Phys. 262 (2014) 104, section 4, who
/// take σ itself and the misfit on the finest mesh for the error of the fit instead. Throws InvalidInput for less than
/// four meshes.
Limit limit_of(const std::vector<double>& cells, const std::vector<Eigen::VectorXd>& values, double highest_order);

}  // namespace tissuewarp::verification
