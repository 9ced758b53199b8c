#include "imaging/detail/file_layout.hpp"

#include "core/errors.hpp"
#include "imaging/detail/gzip.hpp"
#include "imaging/detail/nifti_header.hpp"
#include "imaging/detail/text_headers.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

/// OpenCV counts in int. 2^31 values are 8 GB of float32, beyond any patient's image.
constexpr double most_values = 2147483647.0;

enum class Packing { Raw, Gzip, Zlib };

/// Where the voxels of a file lie and how many bytes they need when unpacked.
struct Payload {
    fs::path file;
    std::uint64_t offset = 0;  ///< first byte of the voxels: in the file when Raw, of the stream otherwise
    std::uint64_t bytes = 0;   ///< unpacked bytes expected from there
    Packing packing = Packing::Raw;
};

std::string text_of(const std::vector<double>& values) {
    std::ostringstream text;
    for (std::size_t i = 0; i < values.size(); ++i) text << (i ? " x " : "") << values[i];
    return text.str();
}

InvalidInput unusable(const fs::path& path, const std::string& cause) {
    return InvalidInput("cannot use '" + path.string() + "': " + cause);
}

/// Product of the sizes, refused when a size is not positive or the product is too large.
std::uint64_t values_of(const fs::path& path, const std::vector<double>& sizes) {
    double product = 1.0;
    for (const double size : sizes) {
        if (!(size >= 1.0)) throw unusable(path, "its size " + text_of(sizes) + " is not positive; correct the header");
        product *= size;
    }
    if (product > most_values)
        throw unusable(path, "its header promises " + text_of(sizes) + " values, limit " +
                                 std::to_string(static_cast<long long>(most_values)) + "; the header is damaged");
    return static_cast<std::uint64_t>(product);
}

void require_spacing(const fs::path& path, double spacing, std::size_t axis) {
    if (std::isfinite(spacing) && spacing != 0.0) return;
    std::ostringstream value;
    value << spacing;
    throw unusable(path, "its spacing along axis " + std::to_string(axis) + " is " + value.str() +
                             " mm; write the true voxel size into the header");
}

void require_three_dimensions(const fs::path& path, const std::vector<double>& sizes, std::size_t dimensions) {
    const bool flat = dimensions < 3 || sizes.size() < 3 || *std::min_element(sizes.begin(), sizes.begin() + 3) == 1.0;
    if (flat)
        throw unusable(path,
                       "its size " + text_of(sizes) + " is a two-dimensional image; give a volume of three dimensions");
}

/// The last four bytes of a gzip file: unpacked size modulo 2^32.
std::uint32_t gzip_trailer(const fs::path& path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    std::array<unsigned char, 4> bytes{};
    if (file.tellg() < 18) return 0;
    file.seekg(-4, std::ios::end);
    file.read(reinterpret_cast<char*>(bytes.data()), 4);
    return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 | std::uint32_t{bytes[3]} << 24;
}

void require_bytes(const fs::path& path, const Payload& payload) {
    std::error_code failure;
    const std::uint64_t on_disk = fs::file_size(payload.file, failure);
    if (failure) throw IoError("cannot read '" + payload.file.string() + "': " + failure.message());
    const auto refuse = [&](std::uint64_t found) {
        throw IoError("'" + path.string() + "' is cut short: its header promises " + std::to_string(payload.bytes) +
                      " bytes of voxels, " + std::to_string(found) + " are there; copy the file again");
    };
    if (payload.packing == Packing::Raw) {
        const std::uint64_t found = on_disk > payload.offset ? on_disk - payload.offset : 0;
        if (found < payload.bytes) refuse(found);
        return;
    }
    // Deflate cannot pack better than 1032 to 1, so an absurd promise is refused before anything is unpacked.
    if (payload.bytes / 1040 > on_disk) refuse(on_disk);
    if (payload.packing == Packing::Gzip) {
        const std::uint64_t whole = payload.offset + payload.bytes;
        // A whole file ends in its unpacked size. The reader verifies the checksum as it unpacks.
        if (gzip_trailer(payload.file) == static_cast<std::uint32_t>(whole)) return;
        const std::uint64_t found = inflated_size(payload.file, 0, whole);
        if (found < whole) refuse(found > payload.offset ? found - payload.offset : 0);
        return;
    }
    const std::uint64_t found = inflated_size(payload.file, payload.offset, payload.bytes);
    if (found < payload.bytes) refuse(found);
    if (found > payload.bytes)
        throw IoError("'" + path.string() + "' is damaged: more data unpack than the " + std::to_string(payload.bytes) +
                      " bytes that its header promises; copy the file again");
}

void check_nifti(const fs::path& path) {
    const NiftiHeader header = read_nifti_header(path);
    const int dimensions = header.dim[0];
    if (dimensions < 1 || dimensions > 7)
        throw IoError("cannot read '" + path.string() + "': its header says " + std::to_string(dimensions) +
                      " dimensions, NIfTI has 1 to 7; the header is damaged");
    std::vector<double> sizes;
    for (int axis = 1; axis <= dimensions; ++axis) sizes.push_back(header.dim[static_cast<std::size_t>(axis)]);
    const std::uint64_t values = values_of(path, sizes);
    require_three_dimensions(path, sizes, sizes.size());
    if (sizes.size() > 3 && sizes[3] > 1)
        throw unusable(path, "it holds " + std::to_string(header.dim[4]) + " time points; extract one of them");
    const double components = sizes.size() > 4 ? sizes[4] : 1.0;
    if ((components != 1.0 && components != 3.0) ||
        std::any_of(sizes.begin() + std::min<std::ptrdiff_t>(5, static_cast<std::ptrdiff_t>(sizes.size())), sizes.end(),
                    [](double size) { return size > 1.0; }))
        throw unusable(path, "its size " + text_of(sizes) +
                                 " is neither a scalar image nor vectors of three components; "
                                 "extract one volume");
    for (std::size_t axis = 1; axis <= 3; ++axis) require_spacing(path, header.pixdim[axis], axis - 1);

    Payload payload{path, 0, 0, Packing::Raw};
    if (header.bits_per_voxel < 8 || !(header.data_offset >= 348.0F && header.data_offset < 1e9F))
        throw IoError("cannot read '" + path.string() + "': " + std::to_string(header.bits_per_voxel) +
                      " bits per voxel from byte " + std::to_string(header.data_offset) + "; the header is damaged");
    payload.offset = static_cast<std::uint64_t>(header.data_offset);
    payload.bytes = values * static_cast<std::uint64_t>(header.bits_per_voxel / 8);
    if (path.extension() == ".gz") payload.packing = Packing::Gzip;
    require_bytes(path, payload);
}

std::uint64_t nrrd_type_bytes(const std::string& type) {
    static const std::map<std::string, std::uint64_t> bytes = {{"signed char", 1},
                                                               {"int8", 1},
                                                               {"int8_t", 1},
                                                               {"uchar", 1},
                                                               {"unsigned char", 1},
                                                               {"uint8", 1},
                                                               {"uint8_t", 1},
                                                               {"short", 2},
                                                               {"short int", 2},
                                                               {"signed short", 2},
                                                               {"signed short int", 2},
                                                               {"int16", 2},
                                                               {"int16_t", 2},
                                                               {"ushort", 2},
                                                               {"unsigned short", 2},
                                                               {"unsigned short int", 2},
                                                               {"uint16", 2},
                                                               {"uint16_t", 2},
                                                               {"int", 4},
                                                               {"signed int", 4},
                                                               {"int32", 4},
                                                               {"int32_t", 4},
                                                               {"uint", 4},
                                                               {"unsigned int", 4},
                                                               {"uint32", 4},
                                                               {"uint32_t", 4},
                                                               {"longlong", 8},
                                                               {"long long", 8},
                                                               {"int64", 8},
                                                               {"int64_t", 8},
                                                               {"ulonglong", 8},
                                                               {"unsigned long long", 8},
                                                               {"uint64", 8},
                                                               {"uint64_t", 8},
                                                               {"float", 4},
                                                               {"double", 8}};
    const auto found = bytes.find(type);
    return found == bytes.end() ? 0 : found->second;
}

/// Spacing per axis from "spacings" or the lengths of "space directions"; axes marked "none" or NaN carry no space.
void check_nrrd_spacing(const fs::path& path, const TextHeader& header) {
    const std::vector<double> spacings = numbers_in(header.value("spacings"));
    for (std::size_t axis = 0; axis < spacings.size(); ++axis)
        if (!std::isnan(spacings[axis])) require_spacing(path, spacings[axis], axis);
    std::istringstream vectors(header.value("space directions"));
    std::size_t axis = 0;
    for (std::string vector; std::getline(vectors, vector, ')'); ++axis) {
        const std::size_t open = vector.find('(');
        if (open == std::string::npos) continue;
        double squared = 0.0;
        for (const double component : numbers_in(vector.substr(open))) squared += component * component;
        require_spacing(path, std::sqrt(squared), axis);
    }
}

void check_nrrd(const fs::path& path) {
    const TextHeader header = read_nrrd_header(path);
    const std::vector<double> sizes = numbers_in(header.value("sizes"));
    const std::uint64_t values = values_of(path, sizes);
    const std::vector<double> dimension = numbers_in(header.value("dimension"));
    const std::string kinds = header.value("kinds");
    const bool vector = kinds.find("vector") != std::string::npos || kinds.find("none") == 0;
    if (dimension.size() != 1 || sizes.size() != static_cast<std::size_t>(std::max(dimension[0], 0.0)))
        throw IoError("cannot read '" + path.string() + "': dimension '" + header.value("dimension") +
                      "' does not fit sizes '" + header.value("sizes") + "'; the header is damaged");
    if (sizes.size() < (vector ? 4 : 3))
        throw unusable(path,
                       "its size " + text_of(sizes) + " is a two-dimensional image; give a volume of three dimensions");
    check_nrrd_spacing(path, header);

    const std::string encoding = header.value("encoding");
    const std::string detached = header.value("data file") + header.value("datafile");
    const std::uint64_t bytes = nrrd_type_bytes(header.value("type"));
    const bool plain = encoding == "raw", packed = encoding == "gzip" || encoding == "gz";
    const bool skips = !header.value("byte skip").empty() || !header.value("line skip").empty();
    if (bytes == 0 || !(plain || packed) || skips || detached.find_first_of("% ") != std::string::npos ||
        detached == "LIST")
        return;
    Payload payload{path, header.bytes, values * bytes, plain ? Packing::Raw : Packing::Zlib};
    if (!detached.empty()) {
        payload.file = path.parent_path() / detached;
        payload.offset = 0;
    }
    require_bytes(path, payload);
}

std::uint64_t meta_type_bytes(const std::string& type) {
    static const std::map<std::string, std::uint64_t> bytes = {
        {"MET_CHAR", 1}, {"MET_UCHAR", 1},     {"MET_SHORT", 2},      {"MET_USHORT", 2}, {"MET_INT", 4},
        {"MET_UINT", 4}, {"MET_LONG_LONG", 8}, {"MET_ULONG_LONG", 8}, {"MET_FLOAT", 4},  {"MET_DOUBLE", 8}};
    const auto found = bytes.find(type);
    return found == bytes.end() ? 0 : found->second;
}

bool is_true(const std::string& value) {
    return !value.empty() && (std::toupper(static_cast<unsigned char>(value[0])) == 'T' || value[0] == '1');
}

void check_meta(const fs::path& path) {
    const TextHeader header = read_meta_header(path);
    const std::vector<double> sizes = numbers_in(header.value("dimsize"));
    const std::uint64_t values = values_of(path, sizes);
    require_three_dimensions(path, sizes, sizes.size());
    const std::string spacing_key = header.value("elementspacing").empty() ? "elementsize" : "elementspacing";
    const std::vector<double> spacings = numbers_in(header.value(spacing_key));
    for (std::size_t axis = 0; axis < spacings.size(); ++axis) require_spacing(path, spacings[axis], axis);

    const std::string data = header.value("elementdatafile");
    const std::vector<double> channels = numbers_in(header.value("elementnumberofchannels"));
    const std::uint64_t bytes =
        meta_type_bytes(header.value("elementtype")) *
        (channels.size() == 1 && channels[0] >= 1.0 ? static_cast<std::uint64_t>(channels[0]) : 1);
    const bool local = data == "LOCAL" || data == "Local" || data == "local";
    const std::vector<double> header_size = numbers_in(header.value("headersize"));
    if (bytes == 0 || data.find_first_of("% ") != std::string::npos || data == "LIST" || !header_size.empty()) return;
    const bool packed = is_true(header.value("compresseddata"));
    require_bytes(path, {local ? path : path.parent_path() / data, local ? header.bytes : 0, values * bytes,
                         packed ? Packing::Zlib : Packing::Raw});
}

}  // namespace

void require_sound_file(const fs::path& path, Format format) {
    switch (format) {
        case Format::Nifti:
            return check_nifti(path);
        case Format::Nrrd:
            return check_nrrd(path);
        case Format::MetaImage:
            return check_meta(path);
    }
}

}  // namespace tissuewarp::imaging::detail
