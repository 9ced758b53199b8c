#include "report/detail/display.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace tissuewarp::report::detail {

using Eigen::Vector3d;

namespace {

template <class Visit>
void for_each_voxel(const imaging::Geometry& grid, const Visit& visit) {
    std::int64_t offset = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) visit(Vector3d(i, j, k), offset++);
}

/// `right` and `down` are the picture's directions in LPS; the grid covers the box along both.
imaging::Geometry plane_grid(const Vector3d& point, const Box& box, const Vector3d& right, const Vector3d& down,
                             double mm_per_pixel) {
    imaging::Geometry grid;
    grid.direction << right, down, right.cross(down);
    grid.spacing.setConstant(mm_per_pixel);
    const auto pixels = [&](const Vector3d& axis) {
        return std::max(2, static_cast<int>(std::lround(std::abs(axis.dot(box.extent())) / mm_per_pixel)));
    };
    grid.size = {pixels(right), pixels(down), 1};
    const Vector3d normal = grid.direction.col(2);
    const Vector3d centre = box.centre() + normal * normal.dot(point - box.centre());
    grid.origin = centre - (right * (grid.size[0] - 1) + down * (grid.size[1] - 1)) * (mm_per_pixel / 2);
    return grid;
}

}  // namespace

const imaging::Volume& organ_labels(const ReportInput& input) {
    if (input.fixed_labels != nullptr) return *input.fixed_labels;
    if (input.warped_labels != nullptr) return *input.warped_labels;
    throw InvalidInput("report: the fixed or the warped label map is needed");
}

std::optional<Box> label_box(const imaging::Volume& labels) {
    const imaging::Volume integers = labels.as(CV_32S);
    const int* values = integers.data<int>();
    const Eigen::Matrix3d to_point = labels.geometry.index_to_point();
    Vector3d lower = Vector3d::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    for_each_voxel(labels.geometry, [&](const Vector3d& index, std::int64_t offset) {
        if (values[offset] == 0) return;
        const Vector3d point = labels.geometry.origin + to_point * index;
        lower = lower.cwiseMin(point);
        upper = upper.cwiseMax(point);
    });
    if (!(lower[0] <= upper[0])) return std::nullopt;
    return Box{lower, upper};
}

Box around(const Vector3d& centre, const Vector3d& extent) {
    return {centre - extent / 2, centre + extent / 2};
}

std::array<Plane, 3> planes_through(const Vector3d& point, const Box& box, double mm_per_pixel) {
    const Vector3d left(1, 0, 0), back(0, 1, 0), down(0, 0, -1);
    return {{{"axial", "R", "L", "A", "P", 'z', point[2], plane_grid(point, box, left, back, mm_per_pixel)},
             {"coronal", "R", "L", "S", "I", 'y', point[1], plane_grid(point, box, left, down, mm_per_pixel)},
             {"sagittal", "A", "P", "S", "I", 'x', point[0], plane_grid(point, box, back, down, mm_per_pixel)}}};
}

cv::Mat slice(const imaging::Volume& volume, const Plane& plane, imaging::Interpolation interpolation) {
    const imaging::Volume cut = imaging::resample(volume, plane.grid, interpolation);
    return cv::Mat(plane.grid.size[1], plane.grid.size[0], cut.voxels.type(), const_cast<uchar*>(cut.voxels.ptr()))
        .clone();
}

cv::Mat label_slice(const imaging::Volume& labels, const Plane& plane) {
    cv::Mat integers;
    slice(labels, plane, imaging::Interpolation::Nearest).convertTo(integers, CV_32S);
    return integers;
}

Window window_of(const imaging::Volume& image, const Box& box) {
    const imaging::Volume real = image.as(CV_32F);
    std::vector<float> values;
    for_each_voxel(image.geometry, [&](const Vector3d& index, std::int64_t offset) {
        // An eighth of the voxels is plenty for a percentile.
        if (offset % 8 != 0) return;
        const Vector3d point = image.geometry.point(index);
        if ((point.array() >= box.lower.array()).all() && (point.array() <= box.upper.array()).all())
            values.push_back(real.data<float>()[offset]);
    });
    if (values.empty()) return {};
    const auto percentile = [&](double part) {
        const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
        std::nth_element(values.begin(), at, values.end());
        return static_cast<double>(*at);
    };
    const double lower = percentile(0.01), upper = percentile(0.995);
    return {lower, upper > lower ? upper : lower + 1};
}

cv::Mat grey_slice(const imaging::Volume& image, const Window& window, const Plane& plane) {
    cv::Mat grey;
    const double scale = 1 / (window.upper - window.lower);
    slice(image, plane, imaging::Interpolation::Linear).convertTo(grey, CV_32F, scale, -window.lower * scale);
    grey = cv::max(cv::min(grey, 1.0), 0.0);
    return grey;
}

imaging::Volume elastic_magnitude(const imaging::Volume& moving_to_fixed, const Eigen::Isometry3d& alignment) {
    const imaging::Volume field = moving_to_fixed.as(CV_32F);
    imaging::Volume magnitude(field.geometry, CV_32FC1);
    for_each_voxel(field.geometry, [&](const Vector3d& index, std::int64_t offset) {
        const cv::Vec3f& u = field.data<cv::Vec3f>()[offset];
        const Vector3d point = field.geometry.point(index);
        magnitude.data<float>()[offset] =
            static_cast<float>((point + Vector3d(u[0], u[1], u[2]) - alignment * point).norm());
    });
    return magnitude;
}

Focus largest_displacement(const imaging::Volume& moving_to_fixed, const imaging::Volume& magnitude,
                           const imaging::Volume& moving_labels) {
    const imaging::Volume labels =
        imaging::resample(moving_labels.as(CV_32S), magnitude.geometry, imaging::Interpolation::Nearest);
    const imaging::Volume field = moving_to_fixed.as(CV_32F);
    Focus focus{-1.0, Vector3d::Zero(), Vector3d::Zero()};
    for_each_voxel(magnitude.geometry, [&](const Vector3d& index, std::int64_t offset) {
        const double value = magnitude.data<float>()[offset];
        if (labels.data<int>()[offset] == 0 || !(value > focus.displacement)) return;
        const cv::Vec3f& u = field.data<cv::Vec3f>()[offset];
        const Vector3d point = magnitude.geometry.point(index);
        focus = {value, point, point + Vector3d(u[0], u[1], u[2])};
    });
    return focus;
}

}  // namespace tissuewarp::report::detail
