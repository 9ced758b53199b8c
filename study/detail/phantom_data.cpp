#include "study/detail/phantom_data.hpp"

#include "core/errors.hpp"
#include "meshing/tet_mesh.hpp"
#include "study/detail/smooth_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

namespace tissuewarp::study::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr double boundary_correlation_mm = 10;

}  // namespace

imaging::Geometry random_grid(const Matrix3Xd& points, const Eigen::Matrix3d& direction, double voxel_mm,
                              Random& random) {
    constexpr double margin_mm = 8;
    imaging::Geometry grid;
    grid.spacing.setConstant(voxel_mm);
    grid.direction = direction;
    const Matrix3Xd turned = grid.direction.transpose() * points;
    const Vector3d shift = voxel_mm * Vector3d(random.uniform(), random.uniform(), random.uniform());
    const Vector3d lower = turned.rowwise().minCoeff() - shift - Vector3d::Constant(margin_mm);
    const Vector3d extent = turned.rowwise().maxCoeff() - lower + Vector3d::Constant(margin_mm);
    for (std::size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(std::ceil(extent[Eigen::Index(axis)] / voxel_mm)) + 1;
    grid.origin = grid.direction * lower;
    return grid;
}

namespace {

/// Six-node triangles of the outer surface.
std::vector<std::array<int, 6>> outer_triangles(const TruthMesh& mesh) {
    std::vector<std::array<int, 6>> triangles;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh.corners)) {
        if (face.outer != 0) continue;
        const auto& [a, b, c] = face.nodes;
        const auto middle = [&](int p, int q) { return mesh.quadratic.middle.at(std::minmax(p, q)); };
        triangles.push_back({a, b, c, middle(a, b), middle(b, c), middle(c, a)});
    }
    return triangles;
}

Vector3d point_of(const std::array<int, 6>& triangle, const Matrix3Xd& nodes, const Vector3d& L) {
    Vector3d point = Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
        const double here = L[Eigen::Index(k)], next = L[Eigen::Index((k + 1) % 3)];
        point += here * (2 * here - 1) * nodes.col(triangle[k]) + 4 * here * next * nodes.col(triangle[3 + k]);
    }
    return point;
}

Vector3d random_barycentric(Random& random) {
    const double root = std::sqrt(random.uniform()), v = random.uniform();
    return {1 - root, root * (1 - v), root * v};
}

/// Points spread evenly over the surface, about one per `mm2`.
Matrix3Xd surface_samples(const DeformedOrgan& organ, double mm2, Random& random) {
    std::vector<Vector3d> samples;
    double owed = random.uniform();
    for (const std::array<int, 6>& triangle : outer_triangles(organ.mesh)) {
        const Vector3d a = organ.nodes.col(triangle[0]), b = organ.nodes.col(triangle[1]),
                       c = organ.nodes.col(triangle[2]);
        for (owed += 0.5 * (b - a).cross(c - a).norm() / mm2; owed >= 1; --owed)
            samples.push_back(point_of(triangle, organ.nodes, random_barycentric(random)));
    }
    Matrix3Xd result(3, Eigen::Index(samples.size()));
    for (std::size_t k = 0; k < samples.size(); ++k) result.col(Eigen::Index(k)) = samples[k];
    return result;
}

}  // namespace

imaging::Volume drawn_labels(const DeformedOrgan& organ, double voxel_mm, double boundary_deviation_mm,
                             Random& random) {
    const SmoothNoise noise(boundary_deviation_mm, boundary_correlation_mm, random);
    const FineTetrahedra tissue(organ.mesh.quadratic, organ.nodes);
    const Eigen::Matrix3d direction = random.rotation();
    imaging::Volume labels(random_grid(organ.nodes, direction, voxel_mm, random), CV_32SC1);
    const imaging::Geometry& grid = labels.geometry;
    auto* voxel = labels.data<std::int32_t>();
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3d point = grid.point({double(i), double(j), double(k)});
                const auto place = tissue.find(point + noise(point));
                *voxel++ = place ? organ.mesh.quadratic.labels[place->element] : 0;
            }
    return labels;
}

namespace {

/// The share of points that faces one way, with noise and outliers.
registration::SurfacePoints seen_of(const Matrix3Xd& samples, double share, double deviation_mm, Random& random,
                                    const std::optional<Vector3d>& facing = {}) {
    constexpr double outliers = 0.03, outlier_mm = 15;
    const Eigen::VectorXd height = samples.transpose() * (facing ? *facing : random.direction());
    std::vector<Eigen::Index> order(std::size_t(samples.cols()));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return height[a] > height[b]; });
    registration::SurfacePoints seen;
    seen.deviation_mm = deviation_mm;
    seen.points.resize(3, Eigen::Index(share * double(samples.cols())));
    for (Eigen::Index k = 0; k < seen.points.cols(); ++k) {
        seen.points.col(k) = samples.col(order[std::size_t(k)]) + deviation_mm * random.normal3();
        if (random.uniform() < outliers)
            seen.points.col(k) += outlier_mm * std::cbrt(random.uniform()) * random.direction();
    }
    seen.normals.resize(3, 0);
    return seen;
}

constexpr double mm2_per_point = 6;

}  // namespace

registration::SurfacePoints seen_surface(const DeformedOrgan& organ, double share, double deviation_mm, Random& random,
                                         const std::optional<Vector3d>& facing) {
    return seen_of(surface_samples(organ, mm2_per_point, random), share, deviation_mm, random, facing);
}

registration::SurfacePoints seen_surface(const TrueTissue& tissue, double share, double deviation_mm, Random& random) {
    return seen_of(surface_samples(tissue, mm2_per_point, random), share, deviation_mm, random);
}

// Places in a thin shell about the surface, as dense as the surface is large, put onto it.
Matrix3Xd surface_samples(const TrueTissue& tissue, double mm2, Random& random) {
    constexpr double half_mm = 1, step_mm = 0.5;
    constexpr double depth_mm = 0.2;  // elements cut off what bulges between their nodes
    const double side = 2 * (tissue.reach + half_mm), box = side * side * side;
    const auto tries = static_cast<int>(box / (2 * half_mm * mm2));
    const auto slope = [&](const Vector3d& x) {
        Vector3d g;
        for (int axis = 0; axis < 3; ++axis) {
            const Vector3d e = step_mm * Vector3d::Unit(axis);
            g[axis] = (tissue.outer_distance(x + e) - tissue.outer_distance(x - e)) / (2 * step_mm);
        }
        return g;
    };
    std::vector<Vector3d> samples;
    for (int k = 0; k < tries; ++k) {
        Vector3d x = tissue.centre +
                     side * (Vector3d(random.uniform(), random.uniform(), random.uniform()) - Vector3d::Constant(0.5));
        if (std::abs(tissue.outer_distance(x)) > half_mm) continue;
        for (int iteration = 0; iteration < 3; ++iteration) {
            const Vector3d g = slope(x);
            x -= (tissue.outer_distance(x) + depth_mm) / std::max(g.squaredNorm(), 0.1) * g;
        }
        if (const auto moved = tissue.forward(x)) samples.push_back(*moved);
    }
    if (samples.empty())
        throw InvalidInput("phantom: the organ has no surface of " + std::to_string(int(mm2)) + " mm²");
    Matrix3Xd result(3, Eigen::Index(samples.size()));
    for (std::size_t k = 0; k < samples.size(); ++k) result.col(Eigen::Index(k)) = samples[k];
    return result;
}

imaging::Volume drawn_labels(const TrueTissue& tissue, double voxel_mm, double boundary_deviation_mm, Random& random) {
    const SmoothNoise noise(boundary_deviation_mm, boundary_correlation_mm, random);
    const Matrix3Xd surface = surface_samples(tissue, 100, random);
    const Eigen::Matrix3d direction = random.rotation();
    imaging::Volume labels(random_grid(surface, direction, voxel_mm, random), CV_32SC1);
    const imaging::Geometry& grid = labels.geometry;
    auto* voxel = labels.data<std::int32_t>();
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3d point = grid.point({double(i), double(j), double(k)});
                const auto X = tissue.backward(point + noise(point));
                *voxel++ = X ? tissue.label(*X) : 0;
            }
    return labels;
}

registration::Landmarks places(const TrueTissue& tissue, int count, double depth_mm, Random& random) {
    registration::Landmarks found;
    found.moving.resize(3, count);
    found.fixed.resize(3, count);
    const double reach = tissue.reach;
    for (int k = 0; k < count;) {
        const Vector3d point =
            tissue.centre +
            reach * (2 * Vector3d(random.uniform(), random.uniform(), random.uniform()) - Vector3d::Ones());
        if (tissue.label(point) == 0 || tissue.outer_distance(point) > -depth_mm) continue;
        const auto moved = tissue.forward(point);
        if (!moved) continue;
        found.moving.col(k) = point;
        found.fixed.col(k++) = *moved;
    }
    return found;
}

namespace {

/// A smooth line of `length_mm` that starts at a place and stays in the organ; shorter where it leaves it.
Matrix3Xd vessel(const TrueTissue& tissue, const Vector3d& start, double length_mm, Random& random) {
    constexpr double step_mm = 1, turn = 0.15, depth_mm = 2;
    std::vector<Vector3d> line{start};
    Vector3d along = random.direction();
    while (double(line.size()) * step_mm < length_mm) {
        along = (along + turn * random.normal3()).normalized();
        const Vector3d next = line.back() + step_mm * along;
        if (tissue.outer_distance(next) > -depth_mm || !tissue.forward(next)) break;
        line.push_back(next);
    }
    Matrix3Xd result(3, Eigen::Index(line.size()));
    for (std::size_t k = 0; k < line.size(); ++k) result.col(Eigen::Index(k)) = line[k];
    return result;
}

}  // namespace

registration::Curves vessels(const TrueTissue& tissue, double deviation_mm, Random& random) {
    constexpr int lines = 8, attempts = 400;
    constexpr double least_mm = 15, depth_mm = 4, found = 0.6;  // share of the points that are seen again
    registration::Curves curves;
    curves.deviation_mm = deviation_mm;
    curves.tangents.resize(3, 0);
    std::vector<Vector3d> seen;
    for (int k = 0; k < attempts && int(curves.moving.size()) < lines; ++k) {
        const Vector3d start = places(tissue, 1, depth_mm, random).moving.col(0);
        Matrix3Xd line = vessel(tissue, start, random.uniform(0.3, 0.6) * tissue.length, random);
        if (double(line.cols()) < least_mm) continue;
        const auto first = Eigen::Index(random.uniform(0, 1 - found) * double(line.cols()));
        for (Eigen::Index p = first; p < first + Eigen::Index(found * double(line.cols())); ++p)
            seen.push_back(*tissue.forward(line.col(p)) + deviation_mm * random.normal3());
        curves.moving.push_back(std::move(line));
    }
    curves.fixed.resize(3, Eigen::Index(seen.size()));
    for (std::size_t k = 0; k < seen.size(); ++k) curves.fixed.col(Eigen::Index(k)) = seen[k];
    return curves;
}

registration::PointPairs found_again(registration::Landmarks places, double deviation_mm, Random& random) {
    registration::PointPairs pairs{std::move(places.moving), std::move(places.fixed), deviation_mm};
    for (Eigen::Index k = 0; k < pairs.fixed.cols(); ++k) pairs.fixed.col(k) += deviation_mm * random.normal3();
    return pairs;
}

}  // namespace tissuewarp::study::detail
