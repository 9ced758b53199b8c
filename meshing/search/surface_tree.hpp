#pragma once
/// The closest point of a triangle surface among triangles that face the right way.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace tissuewarp::meshing {

/// Barycentric coordinates of the point of a triangle (corner 0, edges to corners 1 and 2) closest to corner 0 + `p`:
/// Ericson, Real-Time Collision Detection (2005), section 5.1.5.
inline Eigen::Vector3d closest_in_triangle(const Eigen::Vector3d& ab, const Eigen::Vector3d& ac,
                                           const Eigen::Vector3d& p) {
    const double d1 = ab.dot(p), d2 = ac.dot(p);
    if (d1 <= 0.0 && d2 <= 0.0) return {1.0, 0.0, 0.0};
    const Eigen::Vector3d from_b = p - ab, from_c = p - ac;
    const double d3 = ab.dot(from_b), d4 = ac.dot(from_b);
    if (d3 >= 0.0 && d4 <= d3) return {0.0, 1.0, 0.0};
    const double d5 = ab.dot(from_c), d6 = ac.dot(from_c);
    if (d6 >= 0.0 && d5 <= d6) return {0.0, 0.0, 1.0};
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return {1.0 - d1 / (d1 - d3), d1 / (d1 - d3), 0.0};
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return {1.0 - d2 / (d2 - d6), 0.0, d2 / (d2 - d6)};
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
        const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return {0.0, 1.0 - w, w};
    }
    const double sum = va + vb + vc;
    return {va / sum, vb / sum, vc / sum};
}

/// Which triangles a point may belong to.
struct NormalGate {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the point
    double least_cosine = -1;                          ///< between it and the triangle's
    bool oriented = true;                              ///< false: the sign of the normal is not known
};

/// A hierarchy of boxes over triangles. Holds copies of what it needs; queries are thread-safe.
class SurfaceTree {
public:
    struct Hit {
        int triangle = -1;
        Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
        Eigen::Vector3d point = Eigen::Vector3d::Zero();
        Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the nodes, interpolated
        double distance = 0;                               ///< mm
    };

    /// Throws InvalidInput when there is no triangle.
    explicit SurfaceTree(const meshing::SurfaceMesh& surface);

    /// The closest point within `reach_mm` on a triangle that passes the gate; among equally close ones the triangle of
    /// the lowest index. `guess`, a triangle that may be near or -1, changes nothing but the time that it takes.
    [[nodiscard]] std::optional<Hit> closest(const Eigen::Vector3d& point, double reach_mm, const NormalGate& gate = {},
                                             int guess = -1) const;

private:
    struct Box {
        Eigen::AlignedBox3d extent;
        int first = 0, count = 0;  // of the facets in a leaf; count 0: an inner box
        int right = -1;            // the left one follows its parent
    };
    struct Facet {
        Eigen::Matrix3d corners;
        Eigen::Vector3d normal;  // unit
        int triangle;
    };
    struct Nearest;

    meshing::SurfaceMesh surface_;
    Eigen::Matrix3Xd node_normals_;
    std::vector<Facet> facets_;  // as the leaves hold them
    std::vector<int> facet_of_;  // for each triangle
    std::vector<Box> boxes_;

    void build(int first, int count, std::vector<int>& order, const Eigen::Matrix3Xd& centres);
};

}  // namespace tissuewarp::meshing
