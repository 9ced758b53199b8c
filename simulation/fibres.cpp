#include "simulation/fibres.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Vector3d centroid(const meshing::TetMesh& mesh, int tet) {
    return mesh.nodes(Eigen::all, mesh.tets.col(tet)).rowwise().mean();
}

[[noreturn]] void refuse(const Vector3d& at, int label, const std::string& what) {
    char place[80];
    std::snprintf(place, sizeof place, "(%.2f, %.2f, %.2f) mm", at[0], at[1], at[2]);
    throw InvalidInput("the fibres of label " + std::to_string(label) + " have " + what + " at " + place +
                       ", where the label has a tetrahedron; give directions in all of its tissue");
}

Vector3d unit(const Vector3d& direction, const Vector3d& at, int label) {
    if (!direction.allFinite()) refuse(at, label, "a direction that is not finite");
    if (!(direction.norm() > 0)) refuse(at, label, "no direction but zeros");
    return direction.stableNormalized();
}

class Directions {
public:
    Directions(const imaging::Volume& volume, int label)
        : volume_(volume), label_(label), to_index_(volume.geometry.point_to_index()) {
        if (volume.voxels.type() != CV_32FC3)
            throw InvalidInput("the fibres of label " + std::to_string(label) +
                               " are no volume of three components; give vectors along the fibres, LPS");
    }

    [[nodiscard]] Vector3d at(const Vector3d& point) const {
        const Vector3d index = to_index_ * (point - volume_.geometry.origin);
        std::array<int, 3> first{}, nearest{};
        Vector3d fraction;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int last = volume_.geometry.size[axis] - 1;
            const double here = index[static_cast<Eigen::Index>(axis)];
            if (!(here >= -0.5 && here <= last + 0.5)) refuse(point, label_, "no voxel");
            const double clamped = std::clamp(here, 0.0, double(last));
            first[axis] = std::min(static_cast<int>(clamped), std::max(last - 1, 0));
            nearest[axis] = static_cast<int>(std::lround(clamped));
            fraction[static_cast<Eigen::Index>(axis)] = clamped - first[axis];
        }
        const Vector3d side = unit(voxel(nearest), point, label_);
        return unit(averaged(first, fraction, side), point, label_);
    }

private:
    [[nodiscard]] Vector3d voxel(const std::array<int, 3>& at) const {
        const cv::Vec3f& v = volume_.data<cv::Vec3f>()[volume_.offset(at[0], at[1], at[2])];
        return {v[0], v[1], v[2]};
    }

    /// Of the eight voxels from `first` on, turned to one side.
    [[nodiscard]] Vector3d averaged(const std::array<int, 3>& first, const Vector3d& fraction,
                                    const Vector3d& side) const {
        Vector3d sum = Vector3d::Zero();
        for (int corner = 0; corner < 8; ++corner) {
            double weight = 1;
            std::array<int, 3> at = first;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const bool far = corner >> axis & 1;
                const double part = fraction[static_cast<Eigen::Index>(axis)];
                weight *= far ? part : 1 - part;
                if (far && at[axis] + 1 < volume_.geometry.size[axis]) ++at[axis];
            }
            const Vector3d direction = voxel(at);
            if (!(weight > 0) || direction.isZero(0.0)) continue;
            sum += (direction.dot(side) < 0 ? -weight : weight) * direction.normalized();
        }
        return sum;
    }

    const imaging::Volume& volume_;
    int label_;
    Eigen::Matrix3d to_index_;
};

template <class Direction>
Matrix3Xd of_label(const meshing::TetMesh& mesh, int label, const Direction& direction) {
    Matrix3Xd fibres = Matrix3Xd::Zero(3, mesh.tet_count());
    for (int e = 0; e < mesh.tet_count(); ++e)
        if (mesh.labels[e] == label) fibres.col(e) = direction(e);
    return fibres;
}

}  // namespace

Matrix3Xd fibres_of(const FibreVolume& fibres, const meshing::TetMesh& mesh, int label) {
    const Directions directions(fibres.directions, label);
    return of_label(mesh, label, [&](int e) { return directions.at(centroid(mesh, e)); });
}

Matrix3Xd fibres_of(const FibresOfTetrahedra& fibres, const meshing::TetMesh& mesh, int label) {
    if (fibres.directions.cols() != mesh.tet_count())
        throw InvalidInput("the fibres of label " + std::to_string(label) + " are " +
                           std::to_string(fibres.directions.cols()) + " directions for " +
                           std::to_string(mesh.tet_count()) + " tetrahedra; give one for each of the mesh's own");
    return of_label(mesh, label, [&](int e) { return unit(fibres.directions.col(e), centroid(mesh, e), label); });
}

}  // namespace tissuewarp::simulation
