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

}  // namespace tissuewarp::tled::detail
