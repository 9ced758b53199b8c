#include "study/detail/field_map.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

/// Places of a lattice in the tissue and up to 10 mm around it, where labels are drawn too.
std::vector<Vector3d> places_of(const TrueTissue& tissue, double step_mm) {
    constexpr double margin_mm = 10;
    std::vector<Vector3d> places;
    const double reach = tissue.reach + margin_mm;
    for (double z = -reach; z <= reach; z += step_mm)
        for (double y = -reach; y <= reach; y += step_mm)
            for (double x = -reach; x <= reach; x += step_mm)
                if (const Vector3d place = tissue.centre + Vector3d(x, y, z); tissue.outer_distance(place) < margin_mm)
                    places.push_back(place);
    return places;
}

struct Variation {
    Vector3d mean = Vector3d::Zero();
    double deviation = 0, largest = 0;
};

Variation variation_of(const std::vector<Vector3d>& values) {
    Variation result;
    for (const Vector3d& value : values) result.mean += value / double(values.size());
    for (const Vector3d& value : values) {
        const double square = (value - result.mean).squaredNorm();
        result.deviation += square / double(values.size());
        result.largest = std::max(result.largest, square);
    }
    result.deviation = std::sqrt(result.deviation);
    result.largest = std::sqrt(result.largest);
    return result;
}

Vector3d random_place(const imaging::Geometry& grid, Random& random) {
    Vector3d index;
    for (std::size_t axis = 0; axis < 3; ++axis)
        index[Eigen::Index(axis)] = random.uniform(0.1, 0.9) * (grid.size[axis] - 1);
    return grid.point(index);
}

double variation_of_whole(const imaging::VectorSampler& field, const imaging::Geometry& grid, Random& random) {
    constexpr int places = 4000;
    std::vector<Vector3d> values;
    for (int n = 0; n < places; ++n) values.push_back(field.value(random_place(grid, random)));
    return variation_of(values).deviation;
}

}  // namespace

FieldMap::FieldMap(const imaging::Volume& field, const TrueTissue& tissue, double motion_mm, Random& random)
    : field_(field), centre_(tissue.centre), turn_(random.rotation()) {
    constexpr int draws = 30;
    constexpr double coarse_mm = 8, fine_mm = 4, most_strain = 0.5, least_mm = 1e-3;
    const double of_whole = variation_of_whole(field_, field.geometry, random);
    const auto coarse = places_of(tissue, coarse_mm);
    Variation most;
    for (int draw = 0; draw < draws && most.deviation < of_whole; ++draw) {
        const Vector3d there = random_place(field.geometry, random);
        std::vector<Vector3d> values;
        for (const Vector3d& place : coarse)
            values.emplace_back(turn_.transpose() * field_.value(turn_ * (place - centre_) + there));
        if (const Variation here = variation_of(values); here.deviation > most.deviation) {
            most = here;
            place_ = there;
        }
    }
    if (!(most.largest > least_mm)) throw InvalidInput("the displacement field does not vary; give one that deforms");
    mean_ = most.mean;
    double strain = 0;
    for (const Vector3d& place : places_of(tissue, fine_mm))
        for (int axis = 0; axis < 3; ++axis) {
            const Vector3d step = fine_mm * Vector3d::Unit(axis);
            strain = std::max(strain, (displacement(place + step) - displacement(place)).norm() / fine_mm);
        }
    scale_ = std::min(motion_mm / most.largest, most_strain / strain);
    motion_mm_ = scale_ * most.largest;
}

Vector3d FieldMap::backward(const Vector3d& point) const {
    constexpr int most_steps = 60;
    constexpr double tolerance_mm = 1e-4;
    Vector3d place = point;
    for (int n = 0; n < most_steps; ++n) {
        const Vector3d next = point - displacement(place);
        const double step = (next - place).norm();
        place = next;
        if (step < tolerance_mm) break;
    }
    return place;
}

}  // namespace tissuewarp::study::detail
