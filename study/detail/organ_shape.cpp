#include "study/detail/organ_shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

struct Proportions {
    const char* kind;
    Vector3d axes;        // of the longest
    double bend, height;  // largest
};

const std::array<Proportions, 3>& proportions() {
    static const std::array<Proportions, 3> all{{{"brain", {1.0, 0.84, 0.78}, 0.05, 0.06},
                                                 {"liver", {1.0, 0.72, 0.5}, 0.15, 0.14},
                                                 {"kidney", {1.0, 0.55, 0.48}, 0.3, 0.07}}};
    return all;
}

template <class Function>
Vector3d gradient(const Function& f, const Vector3d& x) {
    constexpr double step = 1e-3;
    Vector3d g;
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3d e = step * Vector3d::Unit(axis);
        g[axis] = (f(x + e) - f(x - e)) / (2 * step);
    }
    return g;
}

template <class Function>
double distance(const Function& f, const Vector3d& x) {
    return f(x) / gradient(f, x).norm();
}

template <class Function>
Vector3d projected(const Function& f, Vector3d x) {
    for (int iteration = 0; iteration < 5; ++iteration) {
        const Vector3d g = gradient(f, x);
        x -= f(x) / g.squaredNorm() * g;
    }
    return x;
}

}  // namespace

OrganShape::OrganShape(Random& random, const OrganRange& range) {
    const Proportions& like = proportions()[static_cast<std::size_t>(random.index(3))];
    kind_ = like.kind;
    length_ = random.uniform(range.least_length, range.most_length);
    for (int axis = 0; axis < 3; ++axis) axes_[axis] = 0.5 * length_ * like.axes[axis] * random.uniform(0.9, 1.1);
    bend_ = random.uniform(-like.bend, like.bend);
    frame_ = random.rotation();
    centre_ = {random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(-50, 50)};
    const int bumps = 3 + random.index(5);
    for (int k = 0; k < bumps; ++k) {
        const Vector3d direction = random.direction();
        const double height = random.uniform(-like.height, like.height);
        bumps_.push_back({direction, height, random.uniform(2, 6)});
    }
    place_inclusion(random, range.inclusion_radius);
}

void OrganShape::place_inclusion(Random& random, std::optional<double> radius_mm) {
    inclusion_frame_ = random.rotation();
    constexpr double margin_mm = 4;
    for (int attempt = 0;; ++attempt) {
        const double of_length = std::max(0.5 * length_ * random.uniform(0.1, 0.25), 6.0),
                     radius = radius_mm.value_or(of_length) * std::pow(0.97, attempt);
        for (int axis = 0; axis < 3; ++axis) inclusion_axes_[axis] = radius * random.uniform(0.8, 1.2);
        inclusion_centre_ = centre_ + frame_ * (random.uniform(0, 0.7) * random.direction().cwiseProduct(axes_));
        bool within = true;
        for (int k = 0; k < 60 && within; ++k)
            within = level(inclusion_centre_ + (inclusion_axes_.maxCoeff() + margin_mm) * random.direction()) < 0;
        if (within) return;
    }
}

double OrganShape::level(const Vector3d& point) const {
    Vector3d p = frame_.transpose() * (point - centre_);
    p[1] += bend_ * p[0] * p[0] / axes_[0];
    const Vector3d s = p.cwiseQuotient(axes_);
    const double r = s.norm();
    if (r < 1e-6) return -1;
    double logarithm = 0;
    for (const Bump& bump : bumps_)
        logarithm += bump.height * std::exp(bump.sharpness * (bump.direction.dot(s) / r - 1));
    return r * std::exp(-logarithm) - 1;
}

double OrganShape::inclusion_level(const Vector3d& point) const {
    return (inclusion_frame_.transpose() * (point - inclusion_centre_)).cwiseQuotient(inclusion_axes_).norm() - 1;
}

int OrganShape::label(const Vector3d& point) const {
    if (level(point) > 0) return 0;
    return inclusion_level(point) > 0 ? 1 : 2;
}

double OrganShape::outer_distance(const Vector3d& point) const {
    return distance([this](const Vector3d& x) { return level(x); }, point);
}

double OrganShape::inclusion_distance(const Vector3d& point) const {
    return distance([this](const Vector3d& x) { return inclusion_level(x); }, point);
}

Vector3d OrganShape::on_surface(const Vector3d& point) const {
    if (std::abs(outer_distance(point)) < std::abs(inclusion_distance(point)))
        return projected([this](const Vector3d& x) { return level(x); }, point);
    return projected([this](const Vector3d& x) { return inclusion_level(x); }, point);
}

Vector3d OrganShape::normal(const Vector3d& point) const {
    return gradient([this](const Vector3d& x) { return level(x); }, point).normalized();
}

Vector3d OrganShape::surface_point(const Vector3d& direction) const {
    double inside = 0, outside = reach();
    for (int k = 0; k < 60; ++k) {
        const double middle = 0.5 * (inside + outside);
        (level(centre_ + middle * direction) < 0 ? inside : outside) = middle;
    }
    return centre_ + inside * direction;
}

double OrganShape::reach() const {
    double heights = 0;
    for (const Bump& bump : bumps_) heights += std::max(bump.height, 0.0);
    const double ball = axes_.maxCoeff() * std::exp(heights);
    return ball + std::abs(bend_) * ball * ball / axes_[0];
}

imaging::Volume draw(const OrganShape& shape, double voxel_mm) {
    // The box of the surface, seen along many directions.
    Vector3d lower = shape.centre(), upper = shape.centre();
    constexpr int directions = 1500;
    for (int k = 0; k < directions; ++k) {  // Fibonacci's spiral
        const double z = 1 - (2 * k + 1.0) / directions, turn = k * EIGEN_PI * (3 - std::sqrt(5.0)),
                     r = std::sqrt(1 - z * z);
        const Vector3d x = shape.surface_point({r * std::cos(turn), r * std::sin(turn), z});
        lower = lower.cwiseMin(x);
        upper = upper.cwiseMax(x);
    }
    constexpr double margin_mm = 10;
    imaging::Geometry grid;
    grid.spacing.setConstant(voxel_mm);
    grid.origin = lower.array() - margin_mm;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double extent = upper[Eigen::Index(axis)] - lower[Eigen::Index(axis)] + 2 * margin_mm;
        grid.size[axis] = static_cast<int>(std::ceil(extent / voxel_mm)) + 1;
    }
    imaging::Volume labels(grid, CV_32SC1);
    auto* voxel = labels.data<std::int32_t>();
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                *voxel++ = shape.label(grid.point({double(i), double(j), double(k)}));
    return labels;
}

}  // namespace tissuewarp::study::detail
