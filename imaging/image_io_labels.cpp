// Label maps of image_io.hpp.
#include "core/errors.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/image_io.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <sstream>

namespace tissuewarp::imaging {
namespace fs = std::filesystem;

namespace {

template <class T>
void copy_labels(const Volume& image, Volume& labels, const fs::path& path) {
    const T* source = image.voxels.ptr<T>();
    int* target = labels.voxels.ptr<int>();
    const auto count = static_cast<std::size_t>(image.geometry.voxel_count());
    for (std::size_t i = 0; i < count; ++i) {
        const auto value = static_cast<double>(source[i]);
        if (value < 0.0 || value != std::floor(value) || value > std::numeric_limits<int>::max()) {
            throw InvalidInput("cannot use '" + path.string() + "' as a label map: it holds the value " +
                               detail::all_digits(value) +
                               "; labels are whole numbers from 0 on, so give a segmentation, resampled with nearest "
                               "neighbour");
        }
        target[i] = static_cast<int>(value);
    }
}

/// A grey image of whole numbers passes for labels value by value. In a segmentation most voxels continue the label of
/// the one before them (99 in 100 where 2 % of them are noise); in a grey image few do (5 in 100 in a head).
void require_no_grey_image(const Volume& labels, const fs::path& path) {
    constexpr std::int64_t least_pairs = 1000;
    constexpr std::size_t least_values = 16;
    const auto [nx, ny, nz] = labels.geometry.size;
    std::int64_t pairs = 0, equal = 0;
    std::set<int> values;
    const int* voxel = labels.data<int>();
    for (int row = 0; row < ny * nz; ++row, voxel += nx)
        for (int i = 1; i < nx; ++i) {
            if (voxel[i] == 0 || voxel[i - 1] == 0) continue;
            ++pairs;
            equal += voxel[i] == voxel[i - 1];
            if (voxel[i] != voxel[i - 1]) values.insert(voxel[i]);
        }
    if (pairs < least_pairs || values.size() < least_values || 2 * equal >= pairs) return;
    std::ostringstream message;
    message << "cannot use '" << path.string() << "' as a label map: it looks like a grey image (" << values.size()
            << " values up to " << *values.rbegin() << ", and " << 100 * equal / pairs
            << " of 100 neighbours alike); give a segmentation";
    throw InvalidInput(message.str());
}

}  // namespace

Volume read_labels(const fs::path& path) {
    return read_labels_with_notes(path).volume;
}

ReadResult read_labels_with_notes(const fs::path& path) {
    return as_labels(read_volume_with_notes(path), path);
}

ReadResult as_labels(ReadResult read, const fs::path& path) {
    const Volume image = read.volume;
    if (image.channels() != 1)
        throw InvalidInput("cannot use '" + path.string() + "' as a label map: it holds vectors; give a segmentation");
    Volume labels(image.geometry, CV_32S);
    switch (image.voxels.depth()) {
        case CV_8U:
            copy_labels<std::uint8_t>(image, labels, path);
            break;
        case CV_8S:
            copy_labels<std::int8_t>(image, labels, path);
            break;
        case CV_16U:
            copy_labels<std::uint16_t>(image, labels, path);
            break;
        case CV_16S:
            copy_labels<std::int16_t>(image, labels, path);
            break;
        case CV_32S:
            copy_labels<std::int32_t>(image, labels, path);
            break;
        case CV_32F:
            copy_labels<float>(image, labels, path);
            break;
        default:
            copy_labels<double>(image, labels, path);
            break;
    }
    require_no_grey_image(labels, path);
    read.volume = labels;
    return read;
}

}  // namespace tissuewarp::imaging
