#include "imaging/compounding.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_for.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace tissuewarp::imaging {

namespace {

constexpr std::int64_t most_voxels = std::int64_t{1} << 29;

/// Pixels that a probe saw: their value changes in a tenth of the steps from frame to frame. The scanner's picture
/// about the fan does not change, nor in so many steps do a clock and what is around a frame that was blanked.
template <class Value>
cv::Mat1b changing_pixels(const Sweep& sweep) {
    constexpr double least_share = 0.1;
    const int rows = sweep.rows(), columns = sweep.columns();
    cv::Mat1i changes(rows, columns, 0);
    tbb::parallel_for(0, rows, [&](int r) {
        for (std::size_t n = 1; n < sweep.frames.size(); ++n) {
            const Value* before = sweep.pixels.ptr<Value>(sweep.frames[n - 1].slice, r);
            const Value* now = sweep.pixels.ptr<Value>(sweep.frames[n].slice, r);
            for (int c = 0; c < columns; ++c) changes(r, c) += before[c] != now[c];
        }
    });
    const double least = std::max(1.0, least_share * double(sweep.frames.size() - 1));
    return changes >= least;
}

/// mm from the plane of a frame, along its normal.
double distance(const SweepFrame& frame, const Eigen::Vector3d& place) {
    return frame.normal().dot(place - frame.to_patient.translation());
}

/// The part of the pixels that shows something, in its places.
struct SeenPart {
    cv::Rect pixels;

    [[nodiscard]] Eigen::Matrix<double, 3, 4> corners(const SweepFrame& frame) const {
        const double left = pixels.x, top = pixels.y, right = left + pixels.width - 1, bottom = top + pixels.height - 1;
        Eigen::Matrix<double, 3, 4> corners;
        corners << left, right, left, right, top, top, bottom, bottom, 0, 0, 0, 0;
        return frame.to_patient * corners;
    }
    [[nodiscard]] Eigen::Vector3d middle(const SweepFrame& frame) const { return corners(frame).rowwise().mean(); }
    /// How far the corners of one frame lie from the plane of another.
    [[nodiscard]] double largest_step(const SweepFrame& from, const SweepFrame& to) const {
        const Eigen::Matrix<double, 3, 4> places = corners(to);
        double largest = 0;
        for (const auto& place : places.colwise()) largest = std::max(largest, std::abs(distance(from, place)));
        return largest;
    }
};

/// From frame to frame, across them at their middle, mm.
std::vector<double> steps_of(const Sweep& sweep, const SeenPart& part) {
    std::vector<double> steps;
    for (std::size_t n = 1; n < sweep.frames.size(); ++n)
        steps.push_back(std::abs(distance(sweep.frames[n - 1], part.middle(sweep.frames[n]))));
    return steps;
}

void require_no_plane(const Sweep& sweep, const SeenPart& part, double spacing_mm) {
    double farthest = 0;
    for (const SweepFrame& frame : sweep.frames)
        farthest = std::max(farthest, part.largest_step(sweep.frames.front(), frame));
    if (farthest < spacing_mm)
        throw InvalidInput("all frames of the sweep lie within " + std::to_string(farthest) +
                           " mm of one plane; give a sweep whose probe moves across it");
}

Geometry grid_about(const Sweep& sweep, const SeenPart& part, double spacing_mm) {
    Eigen::Vector3d lower = Eigen::Vector3d::Constant(std::numeric_limits<double>::max()), upper = -lower;
    for (const SweepFrame& frame : sweep.frames) {
        const Eigen::Matrix<double, 3, 4> corners = part.corners(frame);
        lower = lower.cwiseMin(corners.rowwise().minCoeff());
        upper = upper.cwiseMax(corners.rowwise().maxCoeff());
    }
    Geometry grid;
    grid.origin = lower;
    grid.spacing.setConstant(spacing_mm);
    double voxels = 1;
    for (int axis = 0; axis < 3; ++axis) {
        const double count = std::floor((upper[axis] - lower[axis]) / spacing_mm) + 1;
        voxels *= count;
        if (count < 2)
            throw InvalidInput("the frames of the sweep span " + std::to_string(upper[axis] - lower[axis]) +
                               " mm along one axis, no volume; give a sweep whose probe moves");
        if (voxels > double(most_voxels))
            throw InvalidInput("a volume with voxels of " + std::to_string(spacing_mm) +
                               " mm would have more than 2^29 of them; give a larger --spacing");
        grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(count);
    }
    return grid;
}

/// Whole numbers i from one to another.
struct Span {
    double first, last;

    /// Leaves those with start + i step between two bounds.
    void narrow(double start, double step, double low, double high) {
        if (std::abs(step) < 1e-12) {
            if (start < low || start > high) last = first - 1;
            return;
        }
        const double a = (low - start) / step, b = (high - start) / step;
        first = std::max(first, std::ceil(std::min(a, b)));
        last = std::min(last, std::floor(std::max(a, b)));
    }
};

/// One frame on the voxels of the volume, between the frames before and after it.
template <class Value>
class Slab {
public:
    Slab(const Sweep& sweep, std::size_t number, const SeenPart& part, const cv::Mat1b& seen, const Geometry& grid,
         const CompoundingOptions& options)
        : pixels_(sweep.pixels.ptr<Value>(sweep.frames[number].slice)), seen_(seen), options_(options) {
        const SweepFrame& frame = sweep.frames[number];
        const Eigen::Affine3d to_place =
            Eigen::Translation3d(grid.origin) * Eigen::Affine3d(Eigen::Matrix3d(grid.index_to_point()));
        from_voxel_ = frame.to_patient.inverse() * to_place;
        double widest = 0;
        for (const std::size_t other : {number - 1, number + 1}) {  // 0 − 1 is beyond the last
            if (other >= sweep.frames.size()) continue;
            const SweepFrame& neighbour = sweep.frames[other];
            const double side = neighbour.normal().dot(frame.normal()) < 0 ? -1 : 1;
            neighbours_.emplace_back();
            neighbours_.back() << side * neighbour.normal().transpose() * to_place.linear(),
                side * distance(neighbour, grid.origin);
            widest = std::max(widest, part.largest_step(frame, neighbour));
        }
        reach_ = std::max(options.spacing_mm, std::min(widest, options.largest_gap_mm));
        find_rows(part.corners(frame), frame.normal(), to_place.inverse());
    }

    /// Adds what the frame shows of a row of voxels to their sums and weights.
    void add_to_row(int j, int k, int count, float* sums, float* weights) const {
        if (j < first_row_[0] || j > last_row_[0] || k < first_row_[1] || k > last_row_[1]) return;
        const Eigen::Vector3d start = from_voxel_ * Eigen::Vector3d(0, j, k), step = from_voxel_.linear().col(0);
        Span span{0, double(count - 1)};
        span.narrow(start.x(), step.x(), 0, seen_.cols - 1);
        span.narrow(start.y(), step.y(), 0, seen_.rows - 1);
        span.narrow(start.z(), step.z(), -reach_, reach_);
        if (span.first > span.last) return;  // either may be far beyond the numbers that an int holds
        for (int i = static_cast<int>(span.first); i <= span.last; ++i) {
            const Eigen::Vector3d at = start + i * step;
            const double weight = weight_of(at.z(), Eigen::Vector3d(i, j, k));
            if (weight <= 0) continue;
            const auto value = value_at(at.x(), at.y());
            if (value < 0) continue;
            sums[i] += static_cast<float>(weight) * value;
            weights[i] += static_cast<float>(weight);
        }
    }

private:
    /// Which rows of voxels it may show.
    void find_rows(const Eigen::Matrix<double, 3, 4>& corners, const Eigen::Vector3d& normal,
                   const Eigen::Affine3d& to_voxel) {
        for (int a = 0; a < 2; ++a) {
            double low = std::numeric_limits<double>::max(), high = -low;
            for (const auto& corner : corners.colwise())
                for (const double side : {-reach_, reach_}) {
                    const double index = (to_voxel * Eigen::Vector3d(corner + side * normal))[a + 1];
                    low = std::min(low, index);
                    high = std::max(high, index);
                }
            first_row_[a] = std::floor(low);
            last_row_[a] = std::ceil(high);
        }
    }

    /// Of a voxel at this distance from the frame: between it and a neighbour, not too far apart, that of a linear
    /// interpolation; a voxel about it what is nearer than that.
    [[nodiscard]] double weight_of(double distance_mm, const Eigen::Vector3d& voxel) const {
        double weight = std::max(0.0, 1 - std::abs(distance_mm) / options_.spacing_mm);
        for (const Eigen::RowVector4d& neighbour : neighbours_) {
            const double other = neighbour.head<3>() * voxel + neighbour[3];
            const double apart = std::abs(distance_mm) + std::abs(other);
            if (distance_mm * other < 0 && apart <= options_.largest_gap_mm)
                weight = std::max(weight, std::abs(other) / apart);
        }
        return weight;
    }

    /// Bilinear; below 0 beyond what the probe saw.
    [[nodiscard]] float value_at(double column, double row) const {
        const int c = static_cast<int>(std::floor(column)), r = static_cast<int>(std::floor(row));
        if (!(column >= 0 && row >= 0) || c >= seen_.cols - 1 || r >= seen_.rows - 1) return -1;
        if (!seen_(r, c) || !seen_(r, c + 1) || !seen_(r + 1, c) || !seen_(r + 1, c + 1)) return -1;
        const Value* upper = pixels_ + std::int64_t{r} * seen_.cols + c;
        const Value* lower = upper + seen_.cols;
        const auto x = static_cast<float>(column - c), y = static_cast<float>(row - r);
        return (1 - y) * ((1 - x) * float(upper[0]) + x * float(upper[1])) +
               y * ((1 - x) * float(lower[0]) + x * float(lower[1]));
    }

    const Value* pixels_;
    const cv::Mat1b& seen_;
    const CompoundingOptions& options_;
    Eigen::Affine3d from_voxel_;
    std::vector<Eigen::RowVector4d> neighbours_;  // mm from their planes, of a voxel; normals as this frame's
    double reach_ = 0;
    std::array<double, 2> first_row_{}, last_row_{};  // j and k
};

/// Its slices; returns how many voxels show something.
template <class Value>
std::int64_t fill(Volume& volume, const Sweep& sweep, const SeenPart& part, const cv::Mat1b& seen_pixels,
                  const CompoundingOptions& options, Observer& observer) {
    std::vector<Slab<Value>> slabs;
    for (std::size_t n = 0; n < sweep.frames.size(); ++n)
        slabs.emplace_back(sweep, n, part, seen_pixels, volume.geometry, options);
    const auto [nx, ny, nz] = volume.geometry.size;
    auto* voxels = volume.data<Value>();
    std::atomic<std::int64_t> seen = 0;
    for (int k = 0; k < nz; ++k) {
        observer.checkpoint("compounding", double(k) / nz);
        tbb::parallel_for(0, ny, [&, nx = nx, ny = ny, k](int j) {
            std::vector<float> sums(static_cast<std::size_t>(nx), 0.F), weights(sums);
            for (const auto& slab : slabs) slab.add_to_row(j, k, nx, sums.data(), weights.data());
            Value* row = voxels + std::int64_t{nx} * (j + std::int64_t{ny} * k);
            std::int64_t count = 0;
            for (std::size_t i = 0; i < sums.size(); ++i) {
                if (weights[i] <= 0) continue;
                row[i] = cv::saturate_cast<Value>(std::max(1.F, sums[i] / weights[i]));
                ++count;
            }
            seen += count;
        });
    }
    return seen;
}

}  // namespace

Compounded compound(const Sweep& sweep, const CompoundingOptions& options, Observer& observer) {
    if (!(options.spacing_mm >= 0.05 && options.spacing_mm <= 10))
        throw InvalidInput("voxels of " + std::to_string(options.spacing_mm) + " mm; give 0.05 to 10 mm");
    if (!(options.largest_gap_mm >= 0 && options.largest_gap_mm <= 100))
        throw InvalidInput("a gap of " + std::to_string(options.largest_gap_mm) + " mm; give 0 to 100 mm");
    const bool bytes = sweep.pixels.depth() == CV_8U;
    const cv::Mat1b seen_pixels = bytes ? changing_pixels<std::uint8_t>(sweep) : changing_pixels<std::uint16_t>(sweep);
    if (cv::countNonZero(seen_pixels) == 0)
        throw InvalidInput("all frames of the sweep show the same; give a sweep whose probe moves");
    const SeenPart part{cv::boundingRect(seen_pixels)};
    require_no_plane(sweep, part, options.spacing_mm);
    Compounded result;
    result.volume = Volume(grid_about(sweep, part, options.spacing_mm), sweep.pixels.depth());
    result.volume.voxels.setTo(0);
    const std::int64_t seen = bytes ? fill<std::uint8_t>(result.volume, sweep, part, seen_pixels, options, observer)
                                    : fill<std::uint16_t>(result.volume, sweep, part, seen_pixels, options, observer);
    if (seen == 0) throw InvalidInput("no voxel lies within a frame; give a smaller --spacing");
    result.seen_share = double(seen) / double(result.volume.geometry.voxel_count());
    std::vector<double> steps = steps_of(sweep, part);
    result.gaps = static_cast<int>(
        std::count_if(steps.begin(), steps.end(), [&](double step) { return step > options.largest_gap_mm; }));
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    result.median_step_mm = *middle;
    return result;
}

}  // namespace tissuewarp::imaging
