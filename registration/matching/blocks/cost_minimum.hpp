#pragma once
/// Minima of costs over lattices of displacements.

#include "registration/matching/blocks/cost_lattice.hpp"
#include "registration/matching/blocks/quadratic_fit.hpp"

#include <optional>

namespace tissuewarp::registration::detail {

inline Eigen::Vector3d as_vector(const Voxel& v) {
    return {double(v[0]), double(v[1]), double(v[2])};
}

/// A minimum of the cost over a lattice.
struct Minimum {
    Voxel at{0, 0, 0};
    double cost = 0;
    Quadratic fit{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};

    [[nodiscard]] Eigen::Vector3d index() const { return as_vector(at) + fit.minimum; }
};

/// The minimum of the 27 costs about a place.
std::optional<Minimum> minimum_of(const CostLattice& near);

/// How clearly the minimum stands out: the least rise of cost, over the mean rise in the lattice, among the places
/// that the curvature says are clearly worse. Along an edge the curvature says no such thing, and no place is a rival.
double uniqueness(const CostLattice& lattice, const Minimum& minimum);

}  // namespace tissuewarp::registration::detail
