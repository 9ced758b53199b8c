#include "imaging/detail/nifti_bytes.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "imaging/detail/itk_image_io.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

namespace tissuewarp::imaging::detail {

namespace {

constexpr std::size_t header_bytes = 352;  // with the four bytes that say that there are no extensions
constexpr std::size_t first_size = 42;     // dim[1], int16 as the two after it

std::string header_of(const Volume& volume, const std::filesystem::path& scratch) {
    Geometry small = volume.geometry;
    small.size = {2, 2, 2};
    const AtomicFile file(scratch);
    write_through_itk(Volume(small, volume.voxels.type()), file.path(), Format::Nifti, {});
    std::string header(header_bytes, '\0');
    if (!std::ifstream(file.path(), std::ios::binary).read(header.data(), header_bytes))
        throw IoError("cannot write '" + scratch.string() + "': its header did not arrive; free space on the disk");
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const int size = volume.geometry.size[axis];
        if (size > std::numeric_limits<std::int16_t>::max())
            throw IoError("cannot write '" + scratch.string() +
                          "': NIfTI holds at most 32767 voxels along an axis, not " + std::to_string(size) +
                          "; use .nrrd");
        const auto stored = static_cast<std::int16_t>(size);
        std::memcpy(header.data() + first_size + 2 * axis, &stored, sizeof stored);
    }
    return header;
}

/// Components one after the other, as NIfTI has them, from vectors one after the other.
template <class T>
void copy_planes(const Volume& volume, std::uint64_t first, std::uint64_t count, T* target) {
    const auto voxels = static_cast<std::uint64_t>(volume.geometry.voxel_count());
    const auto channels = static_cast<std::uint64_t>(volume.channels());
    const auto* values = volume.data<T>();
    for (std::uint64_t n = first; n < first + count;) {
        const std::uint64_t channel = n / voxels, begin = n % voxels;
        const std::uint64_t length = std::min(voxels - begin, first + count - n);
        for (std::uint64_t v = begin; v < begin + length; ++v) *target++ = values[channels * v + channel];
        n += length;
    }
}

}  // namespace

NiftiBytes::NiftiBytes(const Volume& volume, std::optional<double> step, const std::filesystem::path& scratch)
    : volume_(volume), step_(step), header_(header_of(volume, scratch)) {}

std::uint64_t NiftiBytes::size() const {
    return header_.size() + volume_.voxels.total() * volume_.voxels.elemSize();
}

void NiftiBytes::copy(std::uint64_t first, std::uint64_t count, unsigned char* target) const {
    if (first < header_.size()) {
        const std::uint64_t of_header = std::min<std::uint64_t>(count, header_.size() - first);
        std::memcpy(target, header_.data() + first, of_header);
        first += of_header;
        count -= of_header;
        target += of_header;
    }
    const std::uint64_t value = volume_.voxels.elemSize1();
    if (count > 0) copy_values((first - header_.size()) / value, count / value, target);
}

void NiftiBytes::copy_values(std::uint64_t first, std::uint64_t count, unsigned char* target) const {
    const std::uint64_t bytes = volume_.voxels.elemSize1();
    if (volume_.channels() == 1) {
        std::memcpy(target, volume_.voxels.data + first * bytes, count * bytes);
    } else if (bytes == 1) {
        copy_planes(volume_, first, count, target);
    } else if (bytes == 2) {
        copy_planes(volume_, first, count, reinterpret_cast<std::uint16_t*>(target));
    } else if (bytes == 4) {
        copy_planes(volume_, first, count, reinterpret_cast<std::uint32_t*>(target));
    } else {
        copy_planes(volume_, first, count, reinterpret_cast<std::uint64_t*>(target));
    }
    if (!step_) return;
    auto* values = reinterpret_cast<float*>(target);
    for (std::uint64_t n = 0; n < count; ++n)
        values[n] = static_cast<float>(std::nearbyint(values[n] / *step_) * *step_);
}

}  // namespace tissuewarp::imaging::detail
