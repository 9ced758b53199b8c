#include "imaging/compounding.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_for.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

namespace tissuewarp::imaging {

namespace {

constexpr std::int64_t most_voxels = std::int64_t{1} << 29;

/// Four corners of a frame, LPS mm.
Eigen::Matrix<double, 3, 4> corners_of(const Sweep& sweep, const SweepFrame& frame) {
    const double right = sweep.columns() - 1, bottom = sweep.rows() - 1;
    Eigen::Matrix<double, 3, 4> pixels;
    pixels << 0, right, 0, right, 0, 0, bottom, bottom, 0, 0, 0, 0;
    return frame.to_patient * pixels;
}

/// How far the corners of one frame lie from the plane of another.
double step_across(const Sweep& sweep, const SweepFrame& from, const SweepFrame& to) {
    const Eigen::RowVector3d normal = from.normal().transpose();
    return (normal * (corners_of(sweep, to).colwise() - from.to_patient.translation())).cwiseAbs().maxCoeff();
}

/// Pixels whose value changes from frame to frame: what a probe saw.
template <class Value>
cv::Mat1b changing_pixels(const cv::Mat& pixels) {
    const int frames = pixels.size[0], rows = pixels.size[1], columns = pixels.size[2];
    cv::Mat1b changing(rows, columns, std::uint8_t{0});
    tbb::parallel_for(0, rows, [&](int r) {
        for (int f = 1; f < frames; ++f)
            for (int c = 0; c < columns; ++c)
                if (pixels.at<Value>(f, r, c) != pixels.at<Value>(0, r, c)) changing(r, c) = 1;
    });
    return changing;
}

struct Reaches {
    std::vector<double> of_frame;  // mm across its plane
    double median_step_mm = 0;
    int gaps = 0;
};

Reaches reaches_of(const Sweep& sweep, const CompoundingOptions& options) {
    Reaches reaches{std::vector<double>(sweep.frames.size(), options.spacing_mm), 0, 0};
    std::vector<double> steps;
    for (std::size_t n = 1; n < sweep.frames.size(); ++n) {
        const double step = step_across(sweep, sweep.frames[n - 1], sweep.frames[n]);
        steps.push_back(step);
        if (step > options.largest_gap_mm) {
            ++reaches.gaps;
            continue;
        }
        for (double* reach : {&reaches.of_frame[n - 1], &reaches.of_frame[n]}) *reach = std::max(*reach, step);
    }
    if (steps.empty()) return reaches;
    std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
    reaches.median_step_mm = steps[steps.size() / 2];
    return reaches;
}

Geometry grid_about(const Sweep& sweep, const cv::Rect& part, double spacing_mm) {
    Eigen::Vector3d lower = Eigen::Vector3d::Constant(std::numeric_limits<double>::max()), upper = -lower;
    for (const SweepFrame& frame : sweep.frames)
        for (const int x : {part.x, part.x + part.width - 1})
            for (const int y : {part.y, part.y + part.height - 1}) {
                const Eigen::Vector3d corner = frame.to_patient * Eigen::Vector3d(x, y, 0);
                lower = lower.cwiseMin(corner);
                upper = upper.cwiseMax(corner);
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

/// One frame on the voxels of the volume.
template <class Value>
class Slab {
public:
    Slab(const Sweep& sweep, const SweepFrame& frame, double reach_mm, const cv::Mat1b& changing, const Geometry& grid)
        : pixels_(sweep.pixels.ptr<Value>(frame.slice)),
          changing_(changing),
          reach_(reach_mm),
          from_voxel_(frame.to_patient.inverse() * Eigen::Translation3d(grid.origin) *
                      Eigen::Affine3d(Eigen::Matrix3d(grid.index_to_point()))) {}

    /// Adds what the frame shows of a row of voxels to their sums and weights.
    void add_to_row(int j, int k, int count, float* sums, float* weights) const {
        const Eigen::Vector3d start = from_voxel_ * Eigen::Vector3d(0, j, k), step = from_voxel_.linear().col(0);
        Span span{0, double(count - 1)};
        span.narrow(start.x(), step.x(), 0, changing_.cols - 1);
        span.narrow(start.y(), step.y(), 0, changing_.rows - 1);
        span.narrow(start.z(), step.z(), -reach_, reach_);
        if (span.first > span.last) return;  // either may be far beyond the numbers that an int holds
        for (int i = static_cast<int>(span.first); i <= span.last; ++i) {
            const Eigen::Vector3d at = start + i * step;
            const double weight = 1.0 - std::abs(at.z()) / reach_;
            if (weight <= 0) continue;
            const auto value = value_at(at.x(), at.y());
            if (value < 0) continue;
            sums[i] += static_cast<float>(weight) * value;
            weights[i] += static_cast<float>(weight);
        }
    }

private:
    /// Bilinear; below 0 beyond what the probe saw.
    [[nodiscard]] float value_at(double column, double row) const {
        const int c = static_cast<int>(std::floor(column)), r = static_cast<int>(std::floor(row));
        if (!(column >= 0 && row >= 0) || c >= changing_.cols - 1 || r >= changing_.rows - 1) return -1;
        if (!changing_(r, c) || !changing_(r, c + 1) || !changing_(r + 1, c) || !changing_(r + 1, c + 1)) return -1;
        const Value* upper = pixels_ + std::int64_t{r} * changing_.cols + c;
        const Value* lower = upper + changing_.cols;
        const auto x = static_cast<float>(column - c), y = static_cast<float>(row - r);
        return (1 - y) * ((1 - x) * float(upper[0]) + x * float(upper[1])) +
               y * ((1 - x) * float(lower[0]) + x * float(lower[1]));
    }

    const Value* pixels_;
    const cv::Mat1b& changing_;
    double reach_;
    Eigen::Affine3d from_voxel_;
};

/// Its slices, and how many voxels show something.
template <class Value>
std::int64_t fill(Volume& volume, const Sweep& sweep, const Reaches& reaches, const cv::Mat1b& changing,
                  Observer& observer) {
    std::vector<Slab<Value>> slabs;
    for (std::size_t n = 0; n < sweep.frames.size(); ++n)
        slabs.emplace_back(sweep, sweep.frames[n], reaches.of_frame[n], changing, volume.geometry);
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
    const cv::Mat1b changing =
        bytes ? changing_pixels<std::uint8_t>(sweep.pixels) : changing_pixels<std::uint16_t>(sweep.pixels);
    if (cv::countNonZero(changing) == 0)
        throw InvalidInput("all frames of the sweep show the same; give a sweep whose probe moves");
    const Reaches reaches = reaches_of(sweep, options);
    Compounded result;
    result.volume = Volume(grid_about(sweep, cv::boundingRect(changing), options.spacing_mm), sweep.pixels.depth());
    result.volume.voxels.setTo(0);
    const std::int64_t seen = bytes ? fill<std::uint8_t>(result.volume, sweep, reaches, changing, observer)
                                    : fill<std::uint16_t>(result.volume, sweep, reaches, changing, observer);
    if (seen == 0) throw InvalidInput("no voxel lies within a frame; give a smaller --spacing");
    result.seen_share = double(seen) / double(result.volume.geometry.voxel_count());
    result.median_step_mm = reaches.median_step_mm;
    result.gaps = reaches.gaps;
    return result;
}

}  // namespace tissuewarp::imaging
