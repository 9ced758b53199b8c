#pragma once
/// Linear tetrahedra enriched by a quadratic bubble on every edge: the quadratic elements of the same straight mesh in
/// the hierarchical basis L_a, 4 L_a L_b.

#include "tled/rest_state.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// The corners of the six edges of a tetrahedron.
inline constexpr int tetrahedron_edges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};

/// Vectors of the space are 3 × size(): corners, then bubbles.
struct HierarchicalSpace {
    int corner_count = 0;
    Eigen::Matrix2Xi edge;                          ///< 2 × E, smaller corner first, ascending
    Eigen::Matrix<int, 6, Eigen::Dynamic> edge_of;  ///< 6 × M, edges of every tetrahedron as in tetrahedron_edges
    Incidence incidence;                            ///< edge → 6·element + place

    [[nodiscard]] int edge_count() const { return static_cast<int>(edge.cols()); }
    [[nodiscard]] int size() const { return corner_count + edge_count(); }
    /// The edge between two corners, −1 where there is none.
    [[nodiscard]] int edge_between(int a, int b) const;
};

HierarchicalSpace hierarchical_space(const Eigen::Matrix4Xi& tets, int corner_count);

}  // namespace tissuewarp::tled::detail
