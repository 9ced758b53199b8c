// IMAGE: a header of 72 bytes, whose place is that of the image's middle, and voxels.

#include "server/messages.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

namespace tissuewarp::server {

namespace {

using Eigen::Vector3d;

constexpr std::uint8_t big = 1, little = 2, ras = 1;
constexpr std::size_t header_of_image = 72;

struct ScalarType {
    std::uint8_t code;
    int depth;
    std::size_t bytes;
};
constexpr std::array<ScalarType, 7> scalar_types{
    {{2, CV_8S, 1}, {3, CV_8U, 1}, {4, CV_16S, 2}, {5, CV_16U, 2}, {6, CV_32S, 4}, {10, CV_32F, 4}, {11, CV_64F, 8}}};

struct ImageHeader {
    std::uint8_t components = 0, scalar = 0, endian = 0, coordinate = 0;
    std::array<std::uint16_t, 3> size{}, offset{}, part{};
    std::array<Vector3d, 4> columns;  ///< axes times spacing, and the middle; RAS
};

ImageHeader read_header(Reader& reader) {
    ImageHeader header;
    reader.u16();  // version of the image's header
    header.components = reader.u8();
    header.scalar = reader.u8();
    header.endian = reader.u8();
    header.coordinate = reader.u8();
    for (std::uint16_t& size : header.size) size = reader.u16();
    for (Vector3d& column : header.columns)
        for (int axis = 0; axis < 3; ++axis) column[axis] = reader.f32();
    for (std::uint16_t& offset : header.offset) offset = reader.u16();
    for (std::uint16_t& part : header.part) part = reader.u16();
    return header;
}

/// OpenIGTLink places an image by its middle, ITK by its first voxel.
imaging::Geometry geometry_of(const ImageHeader& header) {
    imaging::Geometry grid;
    Vector3d origin = header.columns[3];
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        const Vector3d& column = header.columns[a];
        grid.size[a] = header.size[a];
        grid.spacing[axis] = column.norm();
        if (!(grid.spacing[axis] > 0) || !column.allFinite())
            throw InvalidInput("the image has voxels without a size; send its spacing in mm");
        grid.direction.col(axis) = Vector3d(-column.x(), -column.y(), column.z()) / grid.spacing[axis];
        origin -= 0.5 * (header.size[a] - 1) * column;
    }
    grid.origin = Vector3d(-origin.x(), -origin.y(), origin.z());
    imaging::require_valid(grid, "the image");
    return grid;
}

void swap_bytes(unsigned char* data, std::size_t count, std::size_t width) {
    for (std::size_t n = 0; n < count; ++n) std::reverse(data + n * width, data + (n + 1) * width);
}

}  // namespace

imaging::Volume read_image(ByteView content) {
    if (content.size() < header_of_image) throw BadMessage("an image has a header of 72 bytes");
    Reader reader(content);
    const ImageHeader header = read_header(reader);
    const auto type = std::find_if(scalar_types.begin(), scalar_types.end(),
                                   [&](const ScalarType& known) { return known.code == header.scalar; });
    if (type == scalar_types.end())
        throw InvalidInput("an image holds values of type " + std::to_string(header.scalar) +
                           "; known are int8, uint8, int16, uint16, int32, float32 and float64");
    if (header.endian != big && header.endian != little) throw BadMessage("an image is neither big nor little endian");
    if (header.components != 1)
        throw InvalidInput("an image has " + std::to_string(header.components) + " components; send one");
    std::uint64_t voxels = 1;
    for (const std::uint16_t size : header.size) voxels *= size;
    if (header.part != header.size || header.offset != std::array<std::uint16_t, 3>{})
        throw InvalidInput("an image was sent in parts; send it as a whole");
    if (voxels == 0) throw InvalidInput("an image holds no voxels");
    if (voxels * type->bytes != reader.left())
        throw BadMessage("an image of " + std::to_string(voxels) + " voxels has " + std::to_string(reader.left()) +
                         " bytes for them");
    imaging::Volume image(geometry_of(header), CV_MAKETYPE(type->depth, 1));
    std::memcpy(image.voxels.data, reader.take(reader.left()).data(), voxels * type->bytes);
    const bool here_little = std::endian::native == std::endian::little;
    if (type->bytes > 1 && here_little != (header.endian == little)) swap_bytes(image.voxels.data, voxels, type->bytes);
    if (type->depth >= CV_32F && !cv::checkRange(image.voxels.reshape(1, 1)))
        throw InvalidInput("an image holds values that are no numbers");
    return image;
}

Bytes encode(const imaging::Volume& image) {
    const imaging::Geometry& grid = image.geometry;
    const auto type = std::find_if(scalar_types.begin(), scalar_types.end(),
                                   [&](const ScalarType& known) { return known.depth == image.voxels.depth(); });
    if (type == scalar_types.end() || (image.channels() != 1 && image.channels() != 3))
        throw InvalidInput("an image of this type cannot be sent");
    if (*std::max_element(grid.size.begin(), grid.size.end()) > 65535)
        throw InvalidInput("an image has more than 65535 voxels along an axis, the most that IMAGE can hold");
    Writer writer;
    writer.bytes().reserve(header_of_image + image.voxels.total() * image.voxels.elemSize());
    writer.u16(1);
    writer.u8(static_cast<std::uint8_t>(image.channels()));
    writer.u8(type->code);
    writer.u8(std::endian::native == std::endian::little ? little : big);
    writer.u8(ras);
    for (const int size : grid.size) writer.u16(static_cast<std::uint16_t>(size));
    const Vector3d middle = grid.point(0.5 * Vector3d(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1));
    for (int column = 0; column < 4; ++column) {
        const Vector3d lps = column < 3 ? Vector3d(grid.spacing[column] * grid.direction.col(column)) : middle;
        writer.f32(-lps.x());
        writer.f32(-lps.y());
        writer.f32(lps.z());
    }
    for (int axis = 0; axis < 3; ++axis) writer.u16(0);
    for (const int size : grid.size) writer.u16(static_cast<std::uint16_t>(size));
    const std::size_t bytes = image.voxels.total() * image.voxels.elemSize();
    writer.raw({image.voxels.data, bytes});
    if (image.channels() == 3 && type->depth == CV_32F) {  // vectors
        auto* vectors = reinterpret_cast<float*>(writer.bytes().data() + header_of_image);
        for (std::size_t n = 0; n < image.voxels.total(); ++n)
            for (const std::size_t axis : {0, 1}) vectors[3 * n + axis] = -vectors[3 * n + axis];
    }
    return std::move(writer.bytes());
}

}  // namespace tissuewarp::server
