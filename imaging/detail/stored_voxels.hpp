#pragma once
/// The voxels of a NIfTI, NRRD or MetaImage file, from bytes to a matrix. Libraries' readers return memory that they
/// did not fill where data are missing or damaged, and say so on the terminal at best; here every byte of the result
/// was read, and every file holds as many as its header promises.

#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

enum class Scalar { Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Float32, Float64 };

/// Bytes of one value.
std::size_t bytes_of(Scalar type);

enum class Packing {
    Raw,
    Deflate,     ///< gzip or zlib
    Text,        ///< numbers between blanks
    Hexadecimal  ///< two digits a byte
};

/// What lies behind the last voxel of a file.
enum class Surplus {
    Allowed,  ///< padding: not read
    Refused   ///< another size or type than the header's, or a header of its own that nobody stated
};

/// One file with voxels, or the part of a file behind its header.
struct Piece {
    std::filesystem::path file;
    std::uint64_t offset = 0;  ///< byte of the file where data (packed or not) begin
};

struct StoredVoxels {
    std::vector<Piece> pieces;  ///< in the order of slices; each holds the same number of values
    Packing packing = Packing::Raw;
    std::uint64_t unpacked_skip = 0;  ///< bytes before the voxels in an unpacked stream (Deflate)
    Surplus surplus = Surplus::Refused;
    Scalar type = Scalar::UInt8;
    bool swapped = false;  ///< the byte order is not this machine's
    std::array<int, 3> size{0, 0, 0};
    int channels = 1;
    bool planar = false;  ///< all voxels of one component, then all of the next; otherwise components side by side
    double slope = 1.0, intercept = 0.0;
};

/// Voxels of `channels` components, 3-D, scaled by slope and intercept (then float32, float64 for integers of 32 bits
/// and more). Integers that OpenCV lacks become int32 when every value fits and float64 otherwise. `path` is the file
/// that the user named. Throws IoError where a file is missing, cut short, damaged or longer than its header promises.
cv::Mat read_stored_voxels(const std::filesystem::path& path, const StoredVoxels& stored);

/// Throws as above without keeping voxels: for files just written.
void require_whole(const std::filesystem::path& path, const StoredVoxels& stored);

}  // namespace tissuewarp::imaging::detail
