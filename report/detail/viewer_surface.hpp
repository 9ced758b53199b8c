#pragma once
/// The organ's surface for the page's viewer, with few enough triangles for a page.

#include "report/page.hpp"

#include <nlohmann/json.hpp>

namespace tissuewarp::report::detail {

/// Nodes of the surface that is shown, at the most: of 65 536 that 16 bits count, what a page has room for.
inline constexpr int most_viewer_nodes = 12'000;

/// Joins the nodes in each cell of a grid, the finest that leaves `most` of them, at the one nearest to their mean
/// (Rossignac, Borrel 1993), and drops triangles without an area. `kept` are the nodes that are left, `triangles` the
/// old ones by their new nodes.
struct Decimated {
    std::vector<int> kept;
    std::vector<std::array<int, 3>> triangles;
    int outer = 0;  ///< how many triangles of the first `outer` ones are left, which come first again
};
Decimated decimated(const Eigen::Matrix3Xd& nodes, const std::vector<std::array<int, 3>>& triangles, int outer,
                    int most);

/// {"nodes", "triangles", "outer", "lower", "extent", "data"}: the first `outer` triangles are the organ's outer
/// surface, the others lie between its labels. "data" holds, little-endian, uint16 positions in 65535ths of the box
/// "lower" (LPS mm), "extent" (mm): of all nodes x, y, z rigidly aligned, of all nodes where they are now; uint16 node
/// indices; uint8 displacements beyond the alignment and estimated errors in 255ths of the limits, and Trust. Null
/// without a mesh.
nlohmann::json viewer_surface(const ReportInput& input, double displacement_mm, double error_mm);

}  // namespace tissuewarp::report::detail
