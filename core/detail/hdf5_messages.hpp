#pragma once
/// The messages of HDF5's object headers that say what a dataset is (format specification, IV.A.2).

#include "core/detail/hdf5_bytes.hpp"

#include <vector>

namespace tissuewarp::detail {

struct Hdf5Range {
    std::uint64_t begin = 0, end = 0;
};

struct Hdf5Type {
    std::uint64_t bytes = 0;  ///< of one value; 0: no type was given
    bool texts = false;       ///< of variable length, in global heaps
};

/// Integers, IEEE floats and texts. Throws IoError for others.
Hdf5Type hdf5_type(const Hdf5Bytes& file, Hdf5Range message);

struct Hdf5Space {
    int rank = -1;  ///< −1: none was given
    std::uint64_t values = 0;
    std::vector<std::uint64_t> sizes;  ///< as many as the rank
};

/// Throws IoError where the file could not hold as many values, packed.
Hdf5Space hdf5_space(const Hdf5Bytes& file, Hdf5Range message);

struct Hdf5Layout {
    enum class Kind { None, Compact, Contiguous, Chunked } kind = Kind::None;
    std::uint64_t address = 0, bytes = 0;  ///< of compact and contiguous data
    std::vector<std::uint64_t> chunk;      ///< sizes, the last that of a value
};
constexpr std::uint64_t hdf5_nowhere = ~std::uint64_t{0};

Hdf5Layout hdf5_layout(const Hdf5Bytes& file, Hdf5Range message);

/// Throws IoError unless they are deflate, shuffle and Fletcher's checksum.
void require_hdf5_filters(const Hdf5Bytes& file, Hdf5Range message);

/// Bytes of a fill value, old and new message.
std::uint64_t hdf5_fill_bytes(const Hdf5Bytes& file, Hdf5Range message, bool old);

}  // namespace tissuewarp::detail
