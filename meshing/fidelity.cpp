// How near a mesh is to its label map. Knows nothing of the mesher: it compares the mesh's interface faces with the
// faces between voxels of different labels, staircase and all.

#include "meshing/detail/triangle_distance.hpp"
#include "meshing/mesher.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <set>

namespace tissuewarp::meshing {

namespace {

using detail::Triangle;

struct Sample {
    Eigen::Vector3d point;
    double area;  ///< mm² that it stands for
};

struct Boundary {
    std::vector<Triangle> triangles;
    std::vector<Sample> samples;
};

/// Faces between voxels of different labels, in LPS; labels that the mesh lacks count as background.
Boundary voxel_boundary(const imaging::Volume& labels, const std::set<int>& meshed) {
    Boundary boundary;
    const auto& size = labels.geometry.size;
    const auto label = [&](const std::array<int, 3>& v) {
        for (int axis = 0; axis < 3; ++axis)
            if (v[axis] < 0 || v[axis] >= size[axis]) return 0;
        const int value = labels.data<int>()[labels.offset(v[0], v[1], v[2])];
        return value != 0 && meshed.contains(value) ? value : 0;
    };
    const Eigen::Matrix3d axes = labels.geometry.index_to_point();
    std::array<int, 3> v;
    for (v[2] = -1; v[2] < size[2]; ++v[2])
        for (v[1] = -1; v[1] < size[1]; ++v[1])
            for (v[0] = -1; v[0] < size[0]; ++v[0]) {
                const int own = label(v);
                for (int axis = 0; axis < 3; ++axis) {
                    std::array<int, 3> next = v;
                    ++next[axis];
                    if (label(next) == own) continue;
                    Eigen::Vector3d index(v[0], v[1], v[2]);
                    index[axis] += 0.5;
                    const Eigen::Vector3d centre = labels.geometry.point(index);
                    const Eigen::Vector3d a = 0.5 * axes.col((axis + 1) % 3), b = 0.5 * axes.col((axis + 2) % 3);
                    boundary.triangles.push_back({centre - a - b, centre + a - b, centre + a + b});
                    boundary.triangles.push_back({centre - a - b, centre + a + b, centre - a + b});
                    boundary.samples.push_back({centre, 4.0 * a.cross(b).norm()});
                }
            }
    return boundary;
}

/// Interface and boundary faces of the mesh, sampled about once per square of side `spacing`.
Boundary mesh_boundary(const TetMesh& mesh, double spacing) {
    Boundary boundary;
    for (const InterfaceFace& face : interface_faces(mesh)) {
        const Triangle t{mesh.nodes.col(face.nodes[0]), mesh.nodes.col(face.nodes[1]), mesh.nodes.col(face.nodes[2])};
        boundary.triangles.push_back(t);
        const Eigen::Vector3d u = t[1] - t[0], w = t[2] - t[0];
        const double area = 0.5 * u.cross(w).norm();
        // n² similar triangles, one sample at the centroid of each.
        const int n = std::max(1, static_cast<int>(std::ceil(std::sqrt(area) / spacing)));
        for (int i = 0; i < n; ++i)
            for (int j = 0; i + j < n; ++j)
                for (int flipped = 0; flipped < (i + j < n - 1 ? 2 : 1); ++flipped) {
                    const double third = flipped ? 2.0 / 3.0 : 1.0 / 3.0;
                    boundary.samples.push_back({t[0] + (i + third) / n * u + (j + third) / n * w, area / (n * n)});
                }
    }
    return boundary;
}

std::vector<double> distances(const std::vector<Sample>& from, const detail::TriangleDistance& to) {
    std::vector<double> result(from.size());
    tbb::parallel_for(std::size_t{0}, from.size(), [&](std::size_t s) { result[s] = to(from[s].point); });
    return result;
}

double percentile_95(std::vector<double> values) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace

Fidelity fidelity(const TetMesh& mesh, const imaging::Volume& volume) {
    require_valid(mesh, "fidelity");
    const imaging::Volume labels = volume.as(CV_32S);
    Fidelity result;
    std::map<int, double> voxels;
    for (long long v = 0; v < labels.geometry.voxel_count(); ++v) ++voxels[labels.data<int>()[v]];
    const Eigen::VectorXd volumes = tet_volumes(mesh);
    for (const auto& [label, count] : voxels)
        if (label != 0) result.volume_ratio[label] = 0.0;
    for (int t = 0; t < mesh.tet_count(); ++t)
        if (const auto found = voxels.find(mesh.labels[t]); found != voxels.end())
            result.volume_ratio[mesh.labels[t]] += volumes[t] / (found->second * labels.geometry.voxel_volume());

    const double spacing = labels.geometry.spacing.minCoeff();
    const Boundary voxel = voxel_boundary(labels, {mesh.labels.begin(), mesh.labels.end()});
    const Boundary faces = mesh_boundary(mesh, spacing);
    if (voxel.samples.empty()) throw InvalidInput("fidelity: the label map has none of the mesh's labels");
    double area = 0.0;
    for (const Sample& sample : faces.samples) area += sample.area;
    const double edge = std::sqrt(area / static_cast<double>(faces.triangles.size()));
    const auto to_voxels = distances(faces.samples, {voxel.triangles, labels.geometry.spacing.maxCoeff()});
    const auto to_mesh = distances(voxel.samples, {faces.triangles, edge});
    for (std::size_t s = 0; s < to_voxels.size(); ++s)
        result.mean_surface_distance_mm += to_voxels[s] * faces.samples[s].area / area;
    result.hausdorff_95_mm = std::max(percentile_95(to_voxels), percentile_95(to_mesh));
    result.hausdorff_mm = std::max(*std::max_element(to_voxels.begin(), to_voxels.end()),
                                   *std::max_element(to_mesh.begin(), to_mesh.end()));
    return result;
}

}  // namespace tissuewarp::meshing
