#include "registration/matching/descriptors/grid_samples.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

/// Reads an image and its mask at continuous indices.
class Reader {
public:
    Reader(const imaging::Volume& image, const imaging::Volume& seen)
        : value_(image.data<float>()), seen_(seen.data<std::uint8_t>()), size_(image.geometry.size) {
        for (std::size_t a = 0; a < 3; ++a) last_[static_cast<Eigen::Index>(a)] = size_[a] - 1;
        stride_ = {1, size_[0], std::ptrdiff_t{size_[0]} * size_[1]};
    }

    void read(const Eigen::Vector3d& index, float& value, std::uint8_t& seen) const {
        value = 0;
        seen = 0;
        std::ptrdiff_t base = 0, nearest = 0;
        std::array<float, 3> fraction;
        for (std::size_t a = 0; a < 3; ++a) {
            const double at = index[static_cast<Eigen::Index>(a)], last = last_[static_cast<Eigen::Index>(a)];
            if (!(at >= -0.5 && at <= last + 0.5)) return;
            const double clamped = std::clamp(at, 0.0, last);
            const int lower = std::min(static_cast<int>(clamped), std::max(size_[a] - 2, 0));
            fraction[a] = static_cast<float>(clamped - lower);
            base += lower * stride_[a];
            nearest += static_cast<int>(clamped + 0.5) * stride_[a];
        }
        value = linear(value_ + base, fraction);
        seen = seen_[nearest];
    }

private:
    const float* value_;
    const std::uint8_t* seen_;
    std::array<int, 3> size_;
    Eigen::Vector3d last_;
    std::array<std::ptrdiff_t, 3> stride_{};

    [[nodiscard]] float linear(const float* p, const std::array<float, 3>& f) const {
        const std::ptrdiff_t i = size_[0] > 1 ? 1 : 0, j = size_[1] > 1 ? stride_[1] : 0,
                             k = size_[2] > 1 ? stride_[2] : 0;
        const auto mix = [](float a, float b, float t) { return a + t * (b - a); };
        const auto plane = [&](const float* q) { return mix(mix(q[0], q[i], f[0]), mix(q[j], q[j + i], f[0]), f[1]); };
        return mix(plane(p), plane(p + k), f[2]);
    }
};

/// Calls visit(i, j, k, place) for the voxels of a region of `grid` with its rim, `place` their index in the image.
template <class Visit>
void for_each_place(const imaging::Geometry& image, const imaging::Geometry& grid, const SearchRegion& region,
                    const Visit& visit) {
    constexpr int rim = GridSamples::rim;
    const Eigen::Matrix3d matrix = image.point_to_index() * grid.index_to_point();
    const Eigen::Vector3d start = image.index(grid.origin);
    tbb::parallel_for(-rim, grid.size[2] + rim, [&](int k) {
        for (int j = -rim; j < grid.size[1] + rim; ++j) {
            const Eigen::Vector3d row = start + matrix.col(1) * j + matrix.col(2) * k;
            const Range range = region.row(j, k, rim);
            for (int i = range.first; i < range.last; ++i) visit(i, j, k, row + matrix.col(0) * i);
        }
    });
}

}  // namespace

imaging::Geometry GridSamples::with_rim(const imaging::Geometry& grid) {
    imaging::Geometry result = grid;
    for (int& size : result.size) size += 2 * rim;
    result.origin = grid.point(Eigen::Vector3d::Constant(-rim));
    return result;
}

GridSamples::GridSamples(const imaging::Geometry& grid) : size_(with_rim(grid).size) {
    const auto count = static_cast<std::size_t>(offset(size_[0] - rim, size_[1] - rim - 1, size_[2] - rim - 1));
    value_ = std::make_unique_for_overwrite<float[]>(count);
    seen_ = std::make_unique_for_overwrite<std::uint8_t[]>(count);
}

GridSamples::GridSamples(const imaging::Volume& image, const imaging::Volume& seen, const imaging::Geometry& grid,
                         const SearchRegion& region)
    : GridSamples(grid) {
    const Reader reader(image, seen);
    for_each_place(image.geometry, grid, region, [&](int i, int j, int k, const Eigen::Vector3d& place) {
        const auto n = static_cast<std::size_t>(offset(i, j, k));
        reader.read(place, value_[n], seen_[n]);
    });
}

GridSamples::GridSamples(const imaging::Volume& image, const imaging::Volume& seen, const imaging::Geometry& grid,
                         const SearchRegion& region, const imaging::Volume& displacement)
    : GridSamples(grid) {
    const Reader reader(image, seen);
    const Eigen::Matrix3d to_index = image.geometry.point_to_index();
    const auto* shift = displacement.data<cv::Vec3f>();
    for_each_place(image.geometry, grid, region, [&](int i, int j, int k, const Eigen::Vector3d& place) {
        const auto n = static_cast<std::size_t>(offset(i, j, k));
        const cv::Vec3f& u = shift[n];
        reader.read(place + to_index * Eigen::Vector3d(u[0], u[1], u[2]), value_[n], seen_[n]);
    });
}

}  // namespace tissuewarp::registration::detail
