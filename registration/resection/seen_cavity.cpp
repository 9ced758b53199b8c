#include "registration/resection/seen_cavity.hpp"

#include "meshing/search/point_tree.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/resection/cavity_wall.hpp"
#include "registration/resection/without_structure.hpp"

#include <tbb/parallel_for.h>

#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

using Eigen::Vector3d;
using imaging::Volume;

namespace {

/// Of the mesh, on the wall of a cavity.
std::vector<int> wall_nodes(const Interfaces& interfaces) {
    std::vector<int> nodes;
    for (const InterfaceNode& node : interfaces.nodes())
        if (node.at_cavity) nodes.push_back(node.node);
    return nodes;
}

/// Sets voxels to whether `holds` says so of their centres, uint8.
template <class Holds>
Volume mask_where(const imaging::Geometry& grid, const Holds& holds) {
    Volume mask(grid, CV_8UC1);
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const std::int64_t n = mask.offset(i, j, k);
                mask.data<std::uint8_t>()[n] = holds(n, grid.point({double(i), double(j), double(k)}));
            }
    });
    return mask;
}

/// Voxels beside the tissue that came from what is gone if they moved as the nearest place of the wall did.
Volume hole_of(const PreparedModel& prepared, const Deformation& deformation, const std::vector<int>& wall,
               const Volume& tissue) {
    const Eigen::Matrix3Xd places = deformation.deformed_nodes();
    const meshing::PointTree nearest(places, wall);
    return mask_where(tissue.geometry, [&](std::int64_t n, const Vector3d& y) {
        if (tissue.data<std::uint8_t>()[n]) return false;
        const int node = nearest.nearest(y).index;
        const Vector3d X =
            deformation.mesh.nodes.col(node) + deformation.placement.linear().transpose() * (y - places.col(node));
        return label_at(prepared.resected, X) != 0;
    });
}

}  // namespace

std::optional<Volume> seen_cavity(const PreparedModel& prepared, const Deformation& deformation, const Volume& fixed,
                                  const FieldOfView& view) {
    const std::vector<int> wall = wall_nodes(prepared.interfaces);
    if (wall.empty()) return std::nullopt;
    const meshing::TetMesh mesh = deformation.deformed_mesh();
    const Volume tissue =
        mask_of_mesh(mesh, grid_about(fixed.geometry, mesh.nodes(Eigen::all, wall), 3 * cavity_options.reach_mm));
    const Volume hole = hole_of(prepared, deformation, wall, tissue);
    Volume organ = hole.clone();
    organ.voxels |= tissue.voxels;
    const CavityView image(fixed, std::move(organ), tissue);
    const double most = cavity_options.most_deviation * image.tissue_deviation;
    const Volume core = mask_where(hole.geometry, [&](std::int64_t n, const Vector3d& y) {
        return hole.data<std::uint8_t>()[n] && image.deviation.data<float>()[n] < most && view.distance(y) < 0;
    });
    const std::vector<Volume> pieces = pieces_of(core, cavity_options.least_core_ml);
    if (pieces.empty()) return std::nullopt;
    Volume cavity(hole.geometry, CV_8UC1);
    for (const Volume& piece : pieces) cavity.voxels |= up_to_wall(image, piece).voxels;
    return cavity;
}

}  // namespace tissuewarp::registration::detail
