#pragma once
/// Bytes as VTK's XML files hold them: base64 or raw, behind a length or in blocks that zlib compressed.

#include "meshing/detail/file_reader.hpp"

#include <string>
#include <string_view>

namespace tissuewarp::meshing::detail {

/// Where the bytes of an array begin, lengths included, and how they stand there.
struct VtkEncoded {
    std::string_view text;
    bool base64 = false;
    bool compressed = false;
    std::size_t header_bytes = 4;  ///< of each length: 4 or 8
};

/// The bytes of the array itself. Throws IoError where the lengths do not fit what is there.
std::string decoded(const VtkEncoded& encoded, const FileReader& file);

/// Deflate makes nothing smaller than by this.
constexpr std::size_t most_compression = 1032;

}  // namespace tissuewarp::meshing::detail
