#pragma once
/// How little of a distance grid must be read where contact is far.

#include "tled/effects.hpp"

namespace tissuewarp::tled::detail {

/// The most by which the sample nearest to a point exceeds the interpolated distance there (distance_to), mm: where
/// that sample is larger, the point is outside the obstacle.
double interpolation_reach(const DistanceGrid& grid);

/// The most by which the interpolated distance changes with the way that a point goes, mm/mm: a point outside the
/// obstacle at distance d stays outside until it has gone d over this.
double interpolation_steepness(const DistanceGrid& grid);

/// How far a point near the surface may go before the interpolated distance can differ by more than `tolerance` (mm)
/// from what its value and gradient at the start foretell, mm; +∞ where no sample is near the surface.
double tangent_reach(const DistanceGrid& grid, double tolerance);

/// Of tangents that stand for the surface of an obstacle: a hundredth of a micrometre.
inline constexpr double tangent_tolerance_mm = 1e-5;

}  // namespace tissuewarp::tled::detail
