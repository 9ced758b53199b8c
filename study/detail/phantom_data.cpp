#include "study/detail/phantom_data.hpp"

#include "meshing/tet_mesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace tissuewarp::study::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

/// A smooth Gaussian field of vectors by random waves: covariance σ² exp(−r²/(2ℓ²)) of each component (Rahimi and Recht
/// 2007).
class SmoothNoise {
public:
    SmoothNoise(double deviation, double length, Random& random) : scale_(deviation * std::sqrt(2.0 / waves)) {
        for (Eigen::Index w = 0; w < 3 * waves; ++w) {
            wave_.col(w) = random.normal3() / length;
            phase_[w] = random.uniform(0, 2 * EIGEN_PI);
        }
    }
    Vector3d operator()(const Vector3d& point) const {
        const Eigen::Array<double, 1, 3 * waves> value = (point.transpose() * wave_ + phase_).array().cos();
        return scale_ * Vector3d(value.segment<waves>(0).sum(), value.segment<waves>(waves).sum(),
                                 value.segment<waves>(2 * waves).sum());
    }

private:
    static constexpr int waves = 40;  // of each component
    double scale_;
    Eigen::Matrix<double, 3, 3 * waves> wave_;
    Eigen::Matrix<double, 1, 3 * waves> phase_;
};

/// A grid of random orientation that holds points with some margin.
imaging::Geometry random_grid(const Matrix3Xd& points, double voxel_mm, Random& random) {
    constexpr double margin_mm = 8;
    imaging::Geometry grid;
    grid.spacing.setConstant(voxel_mm);
    grid.direction = random.rotation();
    const Matrix3Xd turned = grid.direction.transpose() * points;
    const Vector3d shift = voxel_mm * Vector3d(random.uniform(), random.uniform(), random.uniform());
    const Vector3d lower = turned.rowwise().minCoeff() - shift - Vector3d::Constant(margin_mm);
    const Vector3d extent = turned.rowwise().maxCoeff() - lower + Vector3d::Constant(margin_mm);
    for (std::size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(std::ceil(extent[Eigen::Index(axis)] / voxel_mm)) + 1;
    grid.origin = grid.direction * lower;
    return grid;
}

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
    constexpr double correlation_mm = 10;
    const SmoothNoise noise(boundary_deviation_mm, correlation_mm, random);
    const FineTetrahedra tissue(organ.mesh.quadratic, organ.nodes);
    imaging::Volume labels(random_grid(organ.nodes, voxel_mm, random), CV_32SC1);
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

registration::SurfacePoints seen_surface(const DeformedOrgan& organ, double share, double deviation_mm,
                                         Random& random) {
    constexpr double mm2_per_point = 6, outliers = 0.03, outlier_mm = 15;
    const Matrix3Xd samples = surface_samples(organ, mm2_per_point, random);
    const Eigen::VectorXd height = samples.transpose() * random.direction();
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

registration::Landmarks places(const OrganShape& shape,
                               const std::function<std::optional<Vector3d>(const Vector3d&)>& map, int count,
                               double depth_mm, Random& random) {
    registration::Landmarks found;
    found.moving.resize(3, count);
    found.fixed.resize(3, count);
    const double reach = shape.reach();
    for (int k = 0; k < count;) {
        const Vector3d point =
            shape.centre() +
            reach * (2 * Vector3d(random.uniform(), random.uniform(), random.uniform()) - Vector3d::Ones());
        if (shape.label(point) == 0 || shape.outer_distance(point) > -depth_mm) continue;
        const auto moved = map(point);
        if (!moved) continue;
        found.moving.col(k) = point;
        found.fixed.col(k++) = *moved;
    }
    return found;
}

registration::PointPairs found_again(registration::Landmarks places, double deviation_mm, Random& random) {
    registration::PointPairs pairs{std::move(places.moving), std::move(places.fixed), deviation_mm};
    for (Eigen::Index k = 0; k < pairs.fixed.cols(); ++k) pairs.fixed.col(k) += deviation_mm * random.normal3();
    return pairs;
}

}  // namespace tissuewarp::study::detail
