#include "registration/io/point_map_field.hpp"

#include "core/errors.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/LU>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <string>

namespace tissuewarp::registration {

namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using imaging::Geometry;
using imaging::Volume;

/// Calls visit(offset, point) for every voxel of a grid, rows in parallel, each in its order.
template <class Row>
void for_each_row(const Geometry& grid, const Row& row) {
    const int rows = grid.size[1] * grid.size[2];
    tbb::parallel_for(tbb::blocked_range<int>(0, rows, 16), [&](const tbb::blocked_range<int>& range) {
        for (int r = range.begin(); r < range.end(); ++r) row(r % grid.size[1], r / grid.size[1]);
    });
}

template <class Visit>
void for_each_voxel(const Geometry& grid, const Visit& visit) {
    for_each_row(grid, [&](int j, int k) {
        const std::int64_t first = (std::int64_t{k} * grid.size[1] + j) * grid.size[0];
        for (int i = 0; i < grid.size[0]; ++i) visit(first + i, grid.point(Vector3d(i, j, k)));
    });
}

cv::Vec3f stored(const Vector3d& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

Affine3d inverse_of(const Affine3d& linear) {
    const double determinant = linear.linear().determinant();
    if (std::abs(determinant) < 1e-9 || !std::isfinite(determinant))
        throw InvalidInput("its linear part is singular (determinant " + std::to_string(determinant) +
                           ") and has no inverse; give a transform that does not flatten");
    return linear.inverse();
}

/// Solves z + F(z) = q along a row of places q: Newton's method, whose slope is kept while it serves.
class FieldInverse {
public:
    explicit FieldInverse(const Volume& field) : field_(field), step_(0.5 * field.geometry.spacing.minCoeff()) {}

    /// z, begun where the displacement of the place before leads; nothing where no such place is found, and where the
    /// map turns tissue inside out.
    std::optional<Vector3d> operator()(const Vector3d& q) {
        Vector3d z = q - before_, left = residual(z, q);
        bool serves = true;
        for (int step = 0; step < most_steps && left.norm() > inverse_tolerance_mm; ++step) {
            if (!serves) inverse_slope_ = slope(z).inverse();
            Vector3d move = inverse_slope_ * left, next_left = residual(z - move, q);
            for (int halving = 0; halving < most_halvings && !(next_left.norm() < left.norm()); ++halving) {
                move *= 0.5;
                next_left = residual(z - move, q);
            }
            const bool nearer = next_left.norm() < left.norm();
            if (!nearer && !serves) return std::nullopt;
            serves = next_left.norm() < 0.3 * left.norm();
            if (!nearer) continue;
            z -= move;
            left = next_left;
        }
        const Matrix3d here = slope(z);
        if (!(left.norm() <= inverse_tolerance_mm) || !(here.determinant() > 0)) return std::nullopt;
        inverse_slope_ = here.inverse();
        before_ = q - z;
        return z;
    }

private:
    static constexpr int most_steps = 50, most_halvings = 6;

    imaging::VectorSampler field_;
    double step_;  ///< mm, of the differences
    Vector3d before_ = Vector3d::Zero();
    Matrix3d inverse_slope_ = Matrix3d::Identity();

    [[nodiscard]] Vector3d residual(const Vector3d& z, const Vector3d& q) const { return z + field_.value(z) - q; }
    [[nodiscard]] Matrix3d slope(const Vector3d& z) const {
        Matrix3d result = Matrix3d::Identity();
        for (int axis = 0; axis < 3; ++axis) {
            const Vector3d offset = step_ * Vector3d::Unit(axis);
            result.col(axis) += (field_.value(z + offset) - field_.value(z - offset)) / (2 * step_);
        }
        return result;
    }
};

std::string place_text(const Vector3d& place) {
    char text[100];
    std::snprintf(text, sizeof text, "(%.1f, %.1f, %.1f)", place[0], place[1], place[2]);
    return text;
}

}  // namespace

MappedPoint::MappedPoint(const PointMap& map) : before_(map.before), after_(map.after) {
    if (map.field) field_.emplace(*map.field);
}

Vector3d MappedPoint::operator()(const Vector3d& point) const {
    Vector3d z = before_ * point;
    if (field_ && field_->contains(z)) z += field_->value(z);
    return after_ * z;
}

Volume displacement_on(const PointMap& map, const Geometry& grid) {
    const MappedPoint mapped(map);
    Volume field(grid, CV_32FC3);
    auto* vectors = field.data<cv::Vec3f>();
    for_each_voxel(grid, [&](std::int64_t n, const Vector3d& y) { vectors[n] = stored(mapped(y) - y); });
    return field;
}

WithoutLinearPart::WithoutLinearPart(const Volume& displacement, const Affine3d& linear)
    : displacement_(&displacement), back_(inverse_of(linear)) {}

void WithoutLinearPart::operator()(std::int64_t first, std::int64_t count, float* vectors) const {
    const Geometry& grid = displacement_->geometry;
    const auto* total = displacement_->data<cv::Vec3f>();
    const std::int64_t nx = grid.size[0], ny = grid.size[1];
    for (std::int64_t n = first; n < first + count; ++n, vectors += 3) {
        const Vector3d y = grid.point({double(n % nx), double(n / nx % ny), double(n / nx / ny)});
        const Vector3d vector = back_ * (y + Vector3d(total[n][0], total[n][1], total[n][2])) - y;
        Eigen::Vector3f::Map(vectors) = vector.cast<float>();
    }
}

PointMap with_linear_part(const Volume& displacement, const Affine3d& linear) {
    const WithoutLinearPart rest(displacement, linear);
    const Geometry& grid = displacement.geometry;
    PointMap map;
    map.after = linear;
    map.field = Volume(grid, CV_32FC3);
    auto* vectors = map.field->data<float>();
    for_each_row(grid, [&](int j, int k) {
        const std::int64_t first = (std::int64_t{k} * grid.size[1] + j) * grid.size[0];
        rest(first, grid.size[0], vectors + 3 * first);
    });
    return map;
}

std::optional<Geometry> own_grid(const PointMap& map) {
    if (!map.field) return std::nullopt;
    constexpr double most_off = 1e-6;  // of axes of length one
    const Affine3d back = inverse_of(map.before);
    const Matrix3d& turn = back.linear();
    if (!(turn.transpose() * turn).isIdentity(most_off)) return std::nullopt;
    Geometry grid = map.field->geometry;
    grid.origin = back * grid.origin;
    grid.direction = turn * grid.direction;
    return grid;
}

NearestLinear nearest_linear(const PointMap& map) {
    if (!map.field) return {map.after * map.before, 0};
    const Geometry& grid = map.field->geometry;
    const Vector3d middle = grid.point(0.5 * Vector3d(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1));
    const auto* vectors = map.field->data<cv::Vec3f>();
    Eigen::Matrix4d squares = Eigen::Matrix4d::Zero();
    Eigen::Matrix<double, 3, 4> products = Eigen::Matrix<double, 3, 4>::Zero();
    const auto visit = [&](const auto& take) {
        std::int64_t n = 0;
        for (int k = 0; k < grid.size[2]; ++k)
            for (int j = 0; j < grid.size[1]; ++j)
                for (int i = 0; i < grid.size[0]; ++i, ++n)
                    take((Eigen::Vector4d() << grid.point(Vector3d(i, j, k)) - middle, 1).finished(),
                         Vector3d(vectors[n][0], vectors[n][1], vectors[n][2]));
    };
    visit([&](const Eigen::Vector4d& at, const Vector3d& vector) {
        squares += at * at.transpose();
        products += vector * at.transpose();
    });
    const Eigen::Matrix<double, 3, 4> fit = squares.ldlt().solve(products.transpose()).transpose();
    NearestLinear result;
    visit([&](const Eigen::Vector4d& at, const Vector3d& vector) {
        const Vector3d off = map.after.linear() * (fit * at - vector);
        result.furthest_mm = std::max(result.furthest_mm, off.norm());
    });
    Affine3d through_field = Affine3d::Identity();
    through_field.linear() += fit.leftCols<3>();
    through_field.translation() = fit.col(3) - fit.leftCols<3>() * middle;
    result.map = map.after * through_field * map.before;
    return result;
}

PointMap inverse_of_linear(const PointMap& map) {
    if (map.field) throw InvalidInput("it holds a displacement field, whose inverse needs a grid");
    PointMap inverse;
    inverse.after = inverse_of(map.after * map.before);
    return inverse;
}

PointMap inverse_on(const PointMap& map, const Geometry& grid) {
    if (!map.field) return inverse_of_linear(map);
    const Affine3d before = inverse_of(map.before), after = inverse_of(map.after);
    Volume displacement(grid, CV_32FC3);
    auto* vectors = displacement.data<cv::Vec3f>();
    std::atomic<std::int64_t> lost = 0, example = -1;
    for_each_row(grid, [&](int j, int k) {
        FieldInverse inverse(*map.field);
        for (int i = 0; i < grid.size[0]; ++i) {
            const Vector3d x = grid.point(Vector3d(i, j, k));
            const std::int64_t n = (std::int64_t{k} * grid.size[1] + j) * grid.size[0] + i;
            if (const auto z = inverse(after * x))
                vectors[n] = stored(before * *z - x);
            else if (lost++ == 0)
                example = n;
        }
    });
    if (lost > 0) {
        const std::int64_t n = example, nx = grid.size[0], ny = grid.size[1];
        const Vector3d place = grid.point({double(n % nx), double(n / nx % ny), double(n / nx / ny)});
        throw InvalidInput("its displacement field cannot be inverted at " + std::to_string(lost.load()) + " of " +
                           std::to_string(grid.voxel_count()) + " voxels, one of them at " + place_text(place) +
                           " mm, as where it folds; write it without turning its direction");
    }
    return with_linear_part(displacement, inverse_of(map.after * map.before));
}

}  // namespace tissuewarp::registration
