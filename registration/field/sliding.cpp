#include "registration/field/sliding.hpp"

#include "meshing/search/point_tree.hpp"
#include "meshing/search/surface_tree.hpp"

#include <tbb/parallel_for.h>

namespace tissuewarp::registration::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr int smoothings = 4;        // of normals, over neighbours: some facets are rough
constexpr double faces_alike = 0.5;  // cosine between a normal and that of the place it goes to

/// Unit normals of the surface's nodes, each the mean of its neighbours' again and again.
Matrix3Xd smoothed_normals(const meshing::SurfaceMesh& surface) {
    Matrix3Xd normals = meshing::node_normals(surface);
    for (int n = 0; n < smoothings; ++n) {
        Matrix3Xd sum = normals;
        for (const auto& triangle : surface.triangles.colwise())
            for (int c = 0; c < 3; ++c) sum.col(triangle[c]) += normals.col(triangle[(c + 1) % 3]);
        normals = sum.colwise().normalized();
    }
    return normals;
}

}  // namespace

Matrix3Xd motion_across_surface(const Matrix3Xd& nodes, const meshing::BoundarySurface& boundary,
                                const Matrix3Xd& values) {
    meshing::SurfaceMesh surface = boundary.surface;
    surface.nodes = nodes(Eigen::all, boundary.node_of);
    const Matrix3Xd normals = smoothed_normals(surface), moves = values(Eigen::all, boundary.node_of);
    meshing::SurfaceMesh moved = surface;
    moved.nodes += moves;
    const meshing::SurfaceTree goes_to(moved);
    Matrix3Xd across(3, surface.nodes.cols());
    tbb::parallel_for(Eigen::Index{0}, across.cols(), [&](Eigen::Index k) {
        const Vector3d at = surface.nodes.col(k), normal = normals.col(k);
        const auto hit = goes_to.closest(at, moves.col(k).norm() + 1e-9, {normal, faces_alike});
        across.col(k) = normal * normal.dot(hit ? Vector3d(hit->point - at) : Vector3d(moves.col(k)));
    });
    const meshing::PointTree places(surface.nodes);
    Matrix3Xd result(3, nodes.cols());
    tbb::parallel_for(Eigen::Index{0}, nodes.cols(),
                      [&](Eigen::Index n) { result.col(n) = across.col(places.nearest(nodes.col(n)).index); });
    return result;
}

}  // namespace tissuewarp::registration::detail
