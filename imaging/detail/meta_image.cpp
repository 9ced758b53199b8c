/// MetaImage (.mha, .mhd), after the format's description and MetaIO's reader: offsets and axes are LPS mm, a row of
/// TransformMatrix is the direction of an axis.

#include "core/length_units.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/image_header.hpp"
#include "imaging/detail/text_headers.hpp"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

Scalar meta_type(const fs::path& path, const std::string& name) {
    static const std::map<std::string, Scalar> types = {
        {"MET_CHAR", Scalar::Int8},     {"MET_UCHAR", Scalar::UInt8},    {"MET_SHORT", Scalar::Int16},
        {"MET_USHORT", Scalar::UInt16}, {"MET_INT", Scalar::Int32},      {"MET_UINT", Scalar::UInt32},
        {"MET_LONG", Scalar::Int32},    {"MET_ULONG", Scalar::UInt32},   {"MET_LONG_LONG", Scalar::Int64},
        {"MET_FLOAT", Scalar::Float32}, {"MET_DOUBLE", Scalar::Float64}, {"MET_ULONG_LONG", Scalar::UInt64}};
    const auto found = types.find(name);
    if (found == types.end())
        throw unusable(path,
                       "ElementType '" + name + "' is no type of grey values; convert it to MET_SHORT or MET_FLOAT");
    return found->second;
}

/// The value of the first key that the header has: names of one field changed with the years.
std::string value_of(const TextHeader& header, std::initializer_list<const char*> keys) {
    for (const char* key : keys)
        if (const std::string value = header.value(key); !value.empty()) return value;
    return "";
}

bool is_true(const std::string& value) {
    return !value.empty() && (std::toupper(static_cast<unsigned char>(value[0])) == 'T' || value[0] == '1');
}

std::optional<std::vector<double>> numbers_of(const fs::path& path, const TextHeader& header,
                                              std::initializer_list<const char*> keys, std::size_t count) {
    const std::string text = value_of(header, keys);
    if (text.empty()) return std::nullopt;
    const std::vector<double> numbers = numbers_in(text);
    if (numbers.size() != count)
        throw unreadable(path, "its '" + std::string(*keys.begin()) + "' is '" + text + "' where " +
                                   std::to_string(count) + " numbers belong; correct the header");
    return numbers;
}

/// Millimetres of the header's unit; a unit that nobody stated is taken for millimetres, as MetaIO does.
double unit_of(const fs::path& path, const TextHeader& header, std::vector<std::string>& notes) {
    const std::string unit = value_of(header, {"distanceunits", "elementunits"});
    if (unit.empty() || unit == "?") return 1.0;
    const auto millimetres = millimetres_per(unit);
    if (!millimetres)
        throw unusable(path, "DistanceUnits '" + unit + "' is no known unit of length; write mm, cm, m or um");
    if (*millimetres != 1.0) notes.push_back("lengths are given in " + unit + " and were converted to mm");
    return *millimetres;
}

void read_geometry(const fs::path& path, const TextHeader& header, std::size_t dimensions, ImageHeader& image) {
    const double unit = unit_of(path, header, image.notes);
    const auto spacing = numbers_of(path, header, {"elementspacing", "elementsize"}, dimensions);
    const auto offset = numbers_of(path, header, {"offset", "position", "origin"}, dimensions);
    const auto axes = numbers_of(path, header, {"transformmatrix", "rotation", "orientation"}, dimensions * dimensions);
    if (!spacing) image.notes.emplace_back("the header states no ElementSpacing: voxels of 1 mm are taken");
    if (!offset) image.notes.emplace_back("the header states no Offset: (0, 0, 0) is taken");
    if (!axes) image.notes.emplace_back("the header states no TransformMatrix: its axes are taken as LPS");
    image.converted = unit != 1.0;
    image.vector_axes *= unit;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        if (spacing) {
            require_spacing(path, (*spacing)[axis], axis);
            image.geometry.spacing[a] = unit * (*spacing)[axis];
        }
        if (offset) image.geometry.origin[a] = unit * (*offset)[axis];
        for (std::size_t row = 0; axes && row < 3; ++row)
            image.geometry.direction(static_cast<Eigen::Index>(row), a) = (*axes)[axis * dimensions + row];
    }
}

/// HeaderSize: bytes before the voxels of each file; −1: whatever is left when voxels are counted from the end.
void skip_headers(const fs::path& path, const TextHeader& header, std::uint64_t bytes, StoredVoxels& voxels) {
    const std::string text = header.value("headersize");
    if (text.empty()) return;
    const std::vector<double> numbers = numbers_in(text);
    if (numbers.size() != 1 || !(numbers[0] >= -1.0) || numbers[0] != std::floor(numbers[0]))
        throw unusable(path, "HeaderSize '" + text + "' is no number of bytes; give it, or -1 for voxels at the end");
    if (numbers[0] == -1.0 && voxels.packing != Packing::Raw)
        throw unusable(path,
                       "HeaderSize -1 counts from the end and its voxels are not stored as they are; give the "
                       "number of bytes");
    for (Piece& piece : voxels.pieces) {
        if (numbers[0] >= 0.0) {
            piece.offset += static_cast<std::uint64_t>(numbers[0]);
            continue;
        }
        std::error_code failure;
        const std::uint64_t whole = fs::file_size(piece.file, failure);
        if (!failure && whole >= piece.offset + bytes) piece.offset = whole - bytes;
    }
}

void read_layout(const fs::path& path, const TextHeader& header, const std::vector<double>& sizes, ImageHeader& image) {
    StoredVoxels& voxels = image.voxels;
    const std::uint64_t grid = values_of(path, sizes);
    voxels.type = meta_type(path, header.value("elementtype"));
    for (std::size_t axis = 0; axis < 3; ++axis) voxels.size[axis] = static_cast<int>(sizes[axis]);
    if (const auto channels = numbers_of(path, header, {"elementnumberofchannels"}, 1)) {
        values_of(path, {(*channels)[0], static_cast<double>(grid)});
        voxels.channels = static_cast<int>(std::min((*channels)[0], 1024.0));
    }
    const bool big_endian = is_true(value_of(header, {"binarydatabyteordermsb", "elementbyteordermsb"}));
    voxels.swapped = big_endian != (std::endian::native == std::endian::big);
    const std::string binary = header.value("binarydata");
    if (!binary.empty() && !is_true(binary)) voxels.packing = Packing::Text;
    // The length of the packed data (CompressedDataSize) may be missing or wrong: the stream knows its own end.
    if (is_true(header.value("compresseddata"))) voxels.packing = Packing::Deflate;

    const std::string data = header.value("elementdatafile");
    const std::uint64_t bytes = grid * static_cast<std::uint64_t>(voxels.channels) * bytes_of(voxels.type);
    if (lower_case(data) == "local") {
        voxels.pieces = {{path, header.bytes}};
        return skip_headers(path, header, bytes, voxels);
    }
    const auto slices = static_cast<std::uint64_t>(sizes[2]);
    for (const fs::path& file : files_of(path, header, data, slices, slices)) voxels.pieces.push_back({file, 0});
    const std::uint64_t files = voxels.pieces.size();
    if (files != 1 && files != slices)
        throw unusable(path, "its header names " + std::to_string(files) + " files for " + std::to_string(slices) +
                                 " slices; name one file for each slice");
    skip_headers(path, header, bytes / files, voxels);
}

void read_scaling(const fs::path& path, const TextHeader& header, ImageHeader& image) {
    const auto slope = numbers_of(path, header, {"elementtointensityfunctionslope"}, 1);
    const auto offset = numbers_of(path, header, {"elementtointensityfunctionoffset"}, 1);
    if (slope) image.voxels.slope = (*slope)[0];
    if (offset) image.voxels.intercept = (*offset)[0];
    if (!std::isfinite(image.voxels.slope) || !std::isfinite(image.voxels.intercept) || image.voxels.slope == 0.0)
        throw unusable(path, "its ElementToIntensityFunction is not finite, or 0; correct the header");
    if (image.voxels.slope != 1.0 || image.voxels.intercept != 0.0)
        image.notes.emplace_back("values are scaled by the header's ElementToIntensityFunction");
}

}  // namespace

SweepHeader read_meta_sweep_header(const fs::path& path) {
    const std::string name = lower_case(path.filename().string());
    if (!name.ends_with(".mha") && !name.ends_with(".mhd"))
        throw unusable(path, "a sweep is a sequence metafile (.mha, .mhd), as Plus and 3D Slicer write it; give one");
    const TextHeader header = read_meta_header(path);
    if (header.comments.empty())
        throw unusable(path, "its header has no fields of frames (Seq_Frame0000_…); give a sequence as Plus writes it");
    std::vector<double> sizes = numbers_in(header.value("dimsize"));
    values_of(path, sizes);
    if (sizes.size() == 4 && sizes[2] == 1.0) sizes.erase(sizes.begin() + 2);
    if (sizes.size() != 3)
        throw unusable(path,
                       "its size " + text_of(sizes) + " is not that of plane frames; give columns x rows x frames");
    ImageHeader image;
    read_layout(path, header, sizes, image);
    return {image.voxels, header.value("ultrasoundimageorientation"), header.value("ultrasoundimagetype"),
            header.comments};
}

ImageHeader read_meta_image_header(const fs::path& path) {
    const TextHeader header = read_meta_header(path);
    if (!header.comments.empty())
        throw unusable(path,
                       "it holds frames of a tracked probe, each with a place of its own, and is no volume; make "
                       "one with tissuewarp compound");
    std::vector<double> sizes = numbers_in(header.value("dimsize"));
    values_of(path, sizes);
    require_three_dimensions(path, sizes);
    const std::vector<double> dimensions = numbers_in(header.value("ndims"));
    if (dimensions.size() != 1 || dimensions[0] != static_cast<double>(sizes.size()))
        throw unreadable(path, "NDims '" + header.value("ndims") + "' does not fit DimSize '" +
                                   header.value("dimsize") + "'; the header is damaged");
    for (std::size_t axis = 3; axis < sizes.size(); ++axis)
        if (sizes[axis] > 1.0)
            throw unusable(path, "its size " + text_of(sizes) + " is a series of volumes; extract one of them");
    ImageHeader image;
    read_geometry(path, header, sizes.size(), image);
    read_layout(path, header, sizes, image);
    for (std::size_t axis = 0; axis < 3; ++axis) image.geometry.size[axis] = image.voxels.size[axis];
    read_scaling(path, header, image);
    return image;
}

}  // namespace tissuewarp::imaging::detail
