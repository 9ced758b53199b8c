#include "imaging/labels.hpp"

#include "core/errors.hpp"
#include "imaging/detail/label_runs.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <string>

namespace tissuewarp::imaging {

namespace {

/// The map as int32; other integer types are converted.
Volume as_labels(const Volume& labels) {
    if (labels.empty() || labels.channels() != 1 || labels.voxels.depth() > CV_32S)
        throw InvalidInput("label map: voxels must be integers of one component; read it with read_labels");
    return labels.as(CV_32S);
}

Volume nonzero(const Volume& mask) {
    if (mask.empty() || mask.channels() != 1) throw InvalidInput("mask: give voxels of one component");
    cv::Mat result;
    cv::compare(mask.voxels, 0, result, cv::CMP_NE);
    cv::min(result, 1, result);
    return {mask.geometry, result};
}

std::vector<std::int64_t> sizes_of_pieces(const std::vector<detail::LabelRun>& runs) {
    std::vector<std::int64_t> sizes;
    for (const detail::LabelRun& run : runs) {
        if (static_cast<std::size_t>(run.piece) == sizes.size()) sizes.push_back(0);
        sizes[static_cast<std::size_t>(run.piece)] += run.end - run.begin;
    }
    return sizes;
}

void add_run(LabelStatistics& entry, const detail::LabelRun& run) {
    const std::array<int, 3> first{run.begin, run.j, run.k}, past{run.end, run.j + 1, run.k + 1};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        entry.lower[axis] = entry.voxels == 0 ? first[axis] : std::min(entry.lower[axis], first[axis]);
        entry.upper[axis] = entry.voxels == 0 ? past[axis] : std::max(entry.upper[axis], past[axis]);
    }
    const int length = run.end - run.begin;
    entry.voxels += length;
    // Sum of indices for now; divided and mapped to LPS at the end.
    entry.centroid += length * Eigen::Vector3d(0.5 * (run.begin + run.end - 1), run.j, run.k);
}

/// Mean and population standard deviation, in two passes because grey values may lie far from 0.
void add_grey_values(std::map<int, LabelStatistics>& statistics, const std::vector<detail::LabelRun>& runs,
                     const Volume& image) {
    const Volume grey = image.as(CV_64F);
    const auto for_each_value = [&](const auto& visit) {
        for (const detail::LabelRun& run : runs) {
            const double* row = grey.data<double>() + grey.offset(0, run.j, run.k);
            LabelStatistics& entry = statistics[run.label];
            for (int i = run.begin; i < run.end; ++i) visit(entry, row[i]);
        }
    };
    for_each_value([](LabelStatistics& entry, double value) { entry.mean += value; });
    for (auto& [label, entry] : statistics) entry.mean /= static_cast<double>(entry.voxels);
    for_each_value([](LabelStatistics& entry, double value) {
        entry.standard_deviation += (value - entry.mean) * (value - entry.mean);
    });
    for (auto& [label, entry] : statistics)
        entry.standard_deviation = std::sqrt(entry.standard_deviation / static_cast<double>(entry.voxels));
}

}  // namespace

std::vector<int> labels_in(const Volume& labels) {
    const Volume map = as_labels(labels);
    std::set<int> found;
    const int* values = map.data<int>();
    int previous = 0;
    for (long long i = 0; i < map.geometry.voxel_count(); ++i)
        if (values[i] != previous) {
            previous = values[i];
            if (previous != 0) found.insert(previous);
        }
    return {found.begin(), found.end()};
}

std::map<int, LabelStatistics> label_statistics(const Volume& labels, const Volume* image) {
    if (image && !same_grid(labels.geometry, image->geometry))
        throw InvalidInput("label statistics: image and labels lie on different grids; resample one onto the other");
    if (image && image->channels() != 1)
        throw InvalidInput("label statistics: the image holds vectors; give a scalar one");
    const std::vector<detail::LabelRun> runs = detail::connected_runs(as_labels(labels));
    std::map<int, LabelStatistics> statistics;
    int pieces = 0;
    for (const detail::LabelRun& run : runs) {
        LabelStatistics& entry = statistics[run.label];
        entry.label = run.label;
        add_run(entry, run);
        if (run.piece == pieces) {
            ++entry.components;
            ++pieces;
        }
    }
    for (auto& [label, entry] : statistics) {
        entry.volume_mm3 = static_cast<double>(entry.voxels) * labels.geometry.voxel_volume();
        entry.centroid = labels.geometry.point(entry.centroid / static_cast<double>(entry.voxels));
        for (std::size_t axis = 0; axis < 3; ++axis)
            entry.touches_border |= entry.lower[axis] == 0 || entry.upper[axis] == labels.geometry.size[axis];
    }
    if (image) add_grey_values(statistics, runs, *image);
    return statistics;
}

Volume mask_of(const Volume& labels, int label) {
    const Volume map = as_labels(labels);
    cv::Mat mask;
    cv::compare(map.voxels, label, mask, cv::CMP_EQ);
    cv::min(mask, 1, mask);
    return {labels.geometry, mask};
}

Volume mask_of_all(const Volume& labels) {
    return nonzero(labels);
}

double millilitres(const Volume& mask) {
    return mask.empty() ? 0 : cv::countNonZero(mask.voxels.reshape(1, 1)) * mask.geometry.voxel_volume() / 1000;
}

Volume connected_components(const Volume& mask) {
    Volume result = nonzero(mask).as(CV_32S);
    const std::vector<detail::LabelRun> runs = detail::connected_runs(result);
    const std::vector<std::int64_t> sizes = sizes_of_pieces(runs);
    std::vector<int> order(sizes.size());
    std::iota(order.begin(), order.end(), 0);
    // Equal sizes keep the order of their first voxels.
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
        return sizes[static_cast<std::size_t>(a)] > sizes[static_cast<std::size_t>(b)];
    });
    std::vector<int> number(sizes.size());
    for (std::size_t rank = 0; rank < order.size(); ++rank)
        number[static_cast<std::size_t>(order[rank])] = static_cast<int>(rank) + 1;
    for (const detail::LabelRun& run : runs) {
        int* row = result.data<int>() + result.offset(0, run.j, run.k);
        std::fill(row + run.begin, row + run.end, number[static_cast<std::size_t>(run.piece)]);
    }
    return result;
}

Volume largest_component(const Volume& mask) {
    return mask_of(connected_components(mask), 1);
}

Volume without_labels(const Volume& labels, const std::vector<int>& which) {
    if (which.empty()) return labels;
    Volume result = labels.as(CV_32S).clone();
    auto* voxels = result.data<std::int32_t>();
    for (std::int64_t n = 0; n < result.geometry.voxel_count(); ++n)
        if (std::find(which.begin(), which.end(), voxels[n]) != which.end()) voxels[n] = 0;
    return result;
}

void require_labels(const Volume& labels, const std::vector<int>& required, const char* name) {
    const std::vector<int> present = labels_in(labels);
    if (present.empty())
        throw InvalidInput(std::string(name) +
                           ": every voxel is 0; give a label map with labels other than background");
    std::string list;
    for (std::size_t i = 0; i < present.size() && i < 20; ++i) list += (i ? ", " : "") + std::to_string(present[i]);
    if (present.size() > 20) list += ", ...";
    for (const int label : required)
        if (!std::binary_search(present.begin(), present.end(), label))
            throw InvalidInput(std::string(name) + ": label " + std::to_string(label) + " is absent; present are " +
                               list);
}

}  // namespace tissuewarp::imaging
