#include "imaging/detail/distance_transform.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tissuewarp::imaging::detail {

namespace {

/// Lines along one axis, in bundles of neighbours so that strided lines still use whole cache lines.
struct Lines {
    static constexpr int bundle = 16;
    int length = 0;
    std::int64_t stride = 0;     ///< from one voxel of a line to the next
    std::int64_t neighbour = 0;  ///< from one line of a bundle to the next
    int across = 0;              ///< lines that are `neighbour` apart
    int sheets = 0;              ///< groups of such lines
    std::int64_t sheet = 0;      ///< from one group to the next

    Lines(const cv::Mat& volume, int axis) {
        const std::int64_t nx = volume.size[2], ny = volume.size[1], nz = volume.size[0];
        if (axis == 0) *this = {static_cast<int>(nx), 1, nx, static_cast<int>(ny), static_cast<int>(nz), nx * ny};
        if (axis == 1) *this = {static_cast<int>(ny), nx, 1, static_cast<int>(nx), static_cast<int>(nz), nx * ny};
        if (axis == 2) *this = {static_cast<int>(nz), nx * ny, 1, static_cast<int>(nx), static_cast<int>(ny), nx};
    }

    /// Calls work(offset of the first line, number of lines) for every bundle, on all threads.
    template <class Work>
    void for_each_bundle(const Work& work) const {
        const int bundles = (across + bundle - 1) / bundle;
        tbb::parallel_for(tbb::blocked_range<int>(0, sheets * bundles, 8), [&](const tbb::blocked_range<int>& range) {
            for (int b = range.begin(); b < range.end(); ++b) {
                const int first = b % bundles * bundle;
                work(b / bundles * sheet + first * neighbour, std::min(bundle, across - first));
            }
        });
    }

private:
    Lines(int length_, std::int64_t stride_, std::int64_t neighbour_, int across_, int sheets_, std::int64_t sheet_)
        : length(length_), stride(stride_), neighbour(neighbour_), across(across_), sheets(sheets_), sheet(sheet_) {}
};

/// Lower envelope of the parabolas f(q) + w (p - q)² of one line, w = spacing².
class Envelope {
public:
    Envelope(int length, double spacing)
        : weight_(spacing * spacing),
          vertex_(static_cast<std::size_t>(length)),
          height_(vertex_.size()),
          begin_(vertex_.size() + 1) {}

    void transform(float* line, int length) {
        int count = 0;
        for (int q = 0; q < length; ++q)
            if (line[q] < unreached) count = add(count, q, line[q]);
        if (count == 0) return;
        begin_[static_cast<std::size_t>(count)] = std::numeric_limits<double>::infinity();
        std::size_t current = 0;
        for (int p = 0; p < length; ++p) {
            while (begin_[current + 1] < p) ++current;
            const double offset = p - vertex_[current];
            line[p] = static_cast<float>(height_[current] + weight_ * offset * offset);
        }
    }

private:
    /// Adds the parabola at q; parabolas that it hides everywhere are dropped. Returns the new count.
    int add(int count, int q, double height) {
        double start = -std::numeric_limits<double>::infinity();
        while (count > 0) {
            const auto last = static_cast<std::size_t>(count - 1);
            const double v = vertex_[last];
            // Where the new parabola comes below the last one.
            start = 0.5 * ((height - height_[last]) / (weight_ * (q - v)) + (q + v));
            if (start > begin_[last]) break;
            --count;
            start = -std::numeric_limits<double>::infinity();
        }
        const auto slot = static_cast<std::size_t>(count);
        vertex_[slot] = q;
        height_[slot] = height;
        begin_[slot] = start;
        return count + 1;
    }

    double weight_;
    std::vector<double> vertex_, height_, begin_;
};

/// Fills every line with the squared distance to the nearest seed; scan(line of the mask, positions) lists the seeds'
/// positions in units of half voxels, ascending.
template <class Scan>
cv::Mat squared_to_seeds(const cv::Mat& mask, int axis, double spacing, const Scan& scan) {
    cv::Mat squared(3, mask.size.p, CV_32F);
    const Lines lines(mask, axis);
    const std::uint8_t* voxels = mask.ptr<std::uint8_t>();
    float* target = squared.ptr<float>();
    lines.for_each_bundle([&](std::int64_t first, int count) {
        std::vector<int> seeds;
        for (int n = 0; n < count; ++n) {
            const std::int64_t offset = first + n * lines.neighbour;
            seeds.clear();
            scan([&](int p) { return voxels[offset + p * lines.stride] != 0; }, lines.length, seeds);
            std::size_t next = 0;
            for (int p = 0; p < lines.length; ++p) {
                float& out = target[offset + p * lines.stride];
                if (seeds.empty()) {
                    out = unreached;
                    continue;
                }
                while (next + 1 < seeds.size() && std::abs(seeds[next + 1] - 2 * p) <= std::abs(seeds[next] - 2 * p))
                    ++next;
                const double distance = 0.5 * spacing * (seeds[next] - 2 * p);
                out = static_cast<float>(distance * distance);
            }
        }
    });
    return squared;
}

}  // namespace

void parabola_pass(cv::Mat& squared, int axis, double spacing) {
    const Lines lines(squared, axis);
    float* values = squared.ptr<float>();
    struct Scratch {
        Envelope envelope;
        std::vector<float> tile;
    };
    const auto length = static_cast<std::size_t>(lines.length);
    tbb::enumerable_thread_specific<Scratch> scratch([&] {
        return Scratch{Envelope(lines.length, spacing), std::vector<float>(length * Lines::bundle)};
    });
    lines.for_each_bundle([&](std::int64_t first, int count) {
        auto& [envelope, tile] = scratch.local();
        if (lines.stride == 1) {
            for (int n = 0; n < count; ++n) envelope.transform(values + first + n * lines.neighbour, lines.length);
            return;
        }
        for (int p = 0; p < lines.length; ++p)
            for (int n = 0; n < count; ++n)
                tile[static_cast<std::size_t>(n) * length + static_cast<std::size_t>(p)] =
                    values[first + p * lines.stride + n];
        for (int n = 0; n < count; ++n)
            envelope.transform(tile.data() + static_cast<std::size_t>(n) * length, lines.length);
        for (int p = 0; p < lines.length; ++p)
            for (int n = 0; n < count; ++n)
                values[first + p * lines.stride + n] =
                    tile[static_cast<std::size_t>(n) * length + static_cast<std::size_t>(p)];
    });
}

void window_pass(cv::Mat& squared, int axis, double spacing, double reach_mm) {
    const std::int64_t nx = squared.size[2], slice = nx * squared.size[1];
    const int length = axis == 1 ? squared.size[1] : squared.size[0];
    const int sheets = axis == 1 ? squared.size[0] : squared.size[1];
    const std::int64_t stride = axis == 1 ? nx : slice, sheet = axis == 1 ? slice : nx;
    const int reach = static_cast<int>(std::min(std::ceil(reach_mm / spacing), double(length - 1)));
    tbb::enumerable_thread_specific<std::vector<float>> scratch(static_cast<std::size_t>(length * nx));
    tbb::parallel_for(0, sheets, [&](int s) {
        float* values = squared.ptr<float>() + s * sheet;
        float* before = scratch.local().data();
        for (int p = 0; p < length; ++p) std::copy_n(values + p * stride, nx, before + p * nx);
        for (int p = 0; p < length; ++p)
            for (int q = std::max(0, p - reach); q <= std::min(length - 1, p + reach); ++q) {
                const float parabola = static_cast<float>(std::pow(spacing * (q - p), 2));
                const float* from = before + q * nx;
                float* row = values + p * stride;
                for (std::int64_t i = 0; i < nx; ++i) row[i] = std::min(row[i], from[i] + parabola);
            }
    });
}

cv::Mat squared_to_voxels(const cv::Mat& mask, int axis, double spacing) {
    return squared_to_seeds(mask, axis, spacing, [](const auto& inside, int length, std::vector<int>& seeds) {
        for (int p = 0; p < length; ++p)
            if (inside(p)) seeds.push_back(2 * p);
    });
}

cv::Mat squared_to_crossings(const cv::Mat& mask, int axis, double spacing) {
    return squared_to_seeds(mask, axis, spacing, [](const auto& inside, int length, std::vector<int>& seeds) {
        for (int p = 0; p + 1 < length; ++p)
            if (inside(p) != inside(p + 1)) seeds.push_back(2 * p + 1);
    });
}

}  // namespace tissuewarp::imaging::detail
