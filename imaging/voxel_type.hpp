#pragma once
/// Code for the type of a volume's voxels.

#include "core/errors.hpp"
#include "imaging/volume.hpp"

#include <cstdint>
#include <string>

namespace tissuewarp::imaging {

/// call(T()) for the integer type T of the voxels, and what that returns. Throws InvalidInput, which begins with `who`,
/// for others.
template <class Call>
auto with_integer_type(const Volume& volume, const char* who, const Call& call) {
    switch (volume.voxels.depth()) {
        case CV_8U:
            return call(std::uint8_t());
        case CV_8S:
            return call(std::int8_t());
        case CV_16U:
            return call(std::uint16_t());
        case CV_16S:
            return call(std::int16_t());
        case CV_32S:
            return call(std::int32_t());
        default:
            throw InvalidInput(std::string(who) +
                               ": voxels must be integers of one component; read it with read_labels");
    }
}

/// The same for every type but that of half precision, which throws InvalidInput.
template <class Call>
void with_voxel_type(const Volume& volume, const char* who, const Call& call) {
    if (volume.voxels.depth() <= CV_32S) return with_integer_type(volume, who, call);
    if (volume.voxels.depth() == CV_32F) return call(float());
    if (volume.voxels.depth() == CV_64F) return call(double());
    throw InvalidInput(std::string(who) + ": voxels of half precision; convert them to float32");
}

}  // namespace tissuewarp::imaging
