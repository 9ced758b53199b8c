#include "registration/springs/slid_surfaces.hpp"

#include "meshing/search/surface_tree.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

meshing::SurfaceMesh surface_of(const std::vector<int>& nodes, const std::vector<std::array<int, 3>>& faces,
                                const Matrix3Xd& positions) {
    meshing::SurfaceMesh surface;
    surface.nodes = positions(Eigen::all, nodes);
    surface.triangles.resize(3, static_cast<Eigen::Index>(faces.size()));
    for (std::size_t f = 0; f < faces.size(); ++f)
        surface.triangles.col(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
    return surface;
}

/// How far outside of a surface a point lies that faces it along `towards`, mm; nothing where the surface does not go
/// on beside it.
std::optional<double> height_above(const meshing::SurfaceTree& surface, const Vector3d& point,
                                   const Vector3d& towards) {
    constexpr SlidSurfaceOptions options = slid_surface_options;
    const auto hit = surface.closest(point, options.reach_mm, {-towards, options.least_cosine, true});
    if (!hit) return std::nullopt;
    const Vector3d away = point - hit->point;
    const double height = hit->normal.dot(away), beside = (away - height * hit->normal).norm();
    if (beside > std::max(options.most_beside_mm, std::abs(height))) return std::nullopt;
    return height;
}

}  // namespace

void SlidSurfaces::Side::add(const std::array<int, 3>& face) {
    std::array<int, 3> places{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
        const auto [at, fresh] = place.try_emplace(face[corner], static_cast<int>(nodes.size()));
        if (fresh) nodes.push_back(face[corner]);
        places[corner] = at->second;
    }
    faces.push_back(places);
}

SlidSurfaces::SlidSurfaces(const PreparedModel& prepared) : prepared_(prepared) {
    for (const std::array<int, 2>& labels : prepared.options.sliding) {
        Interface interface;
        for (const auto& face : prepared.interfaces.faces_between(labels[0], labels[1])) interface.first.add(face);
        for (const auto& face : prepared.interfaces.faces_between(labels[1], labels[0])) interface.second.add(face);
        for (const tled::SlidingPair& pair : prepared.sliding)
            if (interface.first.place.contains(pair.first) && interface.second.place.contains(pair.second))
                interface.pairs.push_back(pair);
        interfaces_.push_back(std::move(interface));
    }
}

Matrix3Xd SlidSurfaces::forces(const Matrix3Xd& displacement) const {
    if (interfaces_.empty()) return {};
    Matrix3Xd result = Matrix3Xd::Zero(3, displacement.cols());
    for (const Interface& interface : interfaces_) add_forces(interface, displacement, result);
    return result;
}

// A pair's energy is ½ k g², g = n·(u₁ − u₂). With forces k g₀ n and −k g₀ n on its nodes it is least at g = g₀: at the
// g of now and what is open between the surfaces, in the mean of both nodes.
void SlidSurfaces::add_forces(const Interface& interface, const Matrix3Xd& displacement, Matrix3Xd& forces) const {
    const Matrix3Xd positions = prepared_.model.mesh.nodes + displacement;
    const auto deformed = [&](const Side& side) { return surface_of(side.nodes, side.faces, positions); };
    const meshing::SurfaceMesh first = deformed(interface.first), second = deformed(interface.second);
    const meshing::SurfaceTree first_tree(first), second_tree(second);
    const Matrix3Xd first_normals = meshing::node_normals(first), second_normals = meshing::node_normals(second);
    tbb::parallel_for(std::size_t{0}, interface.pairs.size(), [&](std::size_t n) {
        const tled::SlidingPair& pair = interface.pairs[n];
        const auto out_of_first = height_above(second_tree, positions.col(pair.first),
                                               first_normals.col(interface.first.place.at(pair.first))),
                   out_of_second = height_above(first_tree, positions.col(pair.second),
                                                second_normals.col(interface.second.place.at(pair.second)));
        const double apart = !out_of_first    ? out_of_second.value_or(0)
                             : !out_of_second ? *out_of_first
                                              : 0.5 * (*out_of_first + *out_of_second);
        const double now = pair.normal.dot(displacement.col(pair.first) - displacement.col(pair.second));
        const Vector3d force = pair.stiffness * (now + apart) * pair.normal;
        forces.col(pair.first) += force;
        forces.col(pair.second) -= force;
    });
}

}  // namespace tissuewarp::registration::detail
