// POLYDATA: points, cells of four kinds, arrays.

#include "server/messages.hpp"

#include <cmath>

namespace tissuewarp::server {

namespace {

using Eigen::Vector3d;

constexpr std::uint8_t point_scalar = 0x00, point_normal = 0x02;
constexpr std::size_t header_of_mesh = 40, header_of_array = 6;

struct CellCount {
    std::uint32_t cells = 0, bytes = 0;
};

/// Cells of `count.bytes` bytes, each its number of points and they. Throws unless they fit exactly.
std::vector<std::vector<int>> read_cells(Reader& all, const CellCount& count, std::uint32_t points) {
    Reader reader(all.take(count.bytes));
    if (count.cells > count.bytes / 4) throw BadMessage("a mesh has more cells than bytes for them");
    std::vector<std::vector<int>> cells;
    cells.reserve(count.cells);
    for (std::uint32_t c = 0; c < count.cells; ++c) {
        const std::uint32_t corners = reader.u32();
        if (corners > reader.left() / 4) throw BadMessage("a cell of a mesh has more points than bytes for them");
        std::vector<int>& cell = cells.emplace_back();
        cell.reserve(corners);
        for (std::uint32_t k = 0; k < corners; ++k) {
            const std::uint32_t point = reader.u32();
            if (point >= points)
                throw BadMessage("a cell names point " + std::to_string(point) + " of " + std::to_string(points));
            cell.push_back(static_cast<int>(point));
        }
    }
    if (reader.left() > 0) throw BadMessage("the cells of a mesh end before their bytes do");
    return cells;
}

struct ArrayHeader {
    std::uint8_t type = 0, components = 0;
    std::uint32_t count = 0;
};

/// Names end in a zero byte each, and all of them at an even place.
void skip_names(Reader& reader, std::size_t count) {
    std::size_t bytes = 0;
    for (std::size_t n = 0; n < count; ++n)
        while (true) {
            ++bytes;
            if (reader.u8() == 0) break;
        }
    if (bytes % 2 != 0) reader.u8();
}

void read_arrays(Reader& reader, std::uint32_t count, PolyData& mesh) {
    if (count > reader.left() / header_of_array) throw BadMessage("a mesh has more arrays than bytes for them");
    std::vector<ArrayHeader> headers(count);
    for (ArrayHeader& header : headers) {
        header.type = reader.u8();
        header.components = reader.u8();
        header.count = reader.u32();
    }
    skip_names(reader, count);
    for (const ArrayHeader& header : headers) {
        const std::uint64_t bytes = std::uint64_t{4} * header.components * header.count;
        if (bytes > reader.left()) throw BadMessage("an array of a mesh is longer than the message");
        Reader values(reader.take(bytes));
        if (header.type != point_normal) continue;
        if (header.components != 3 || header.count != mesh.points.cols())
            throw BadMessage("a mesh has normals of another number than points");
        mesh.normals.resize(3, mesh.points.cols());
        for (Eigen::Index p = 0; p < mesh.points.cols(); ++p) {
            const double x = values.f32(), y = values.f32(), z = values.f32();
            mesh.normals.col(p) = Vector3d(-x, -y, z);
        }
    }
}

void take_normals(PolyData& mesh) {
    for (Eigen::Index p = 0; p < mesh.normals.cols(); ++p) {
        const double length = mesh.normals.col(p).norm();
        if (!(length > 0) || !std::isfinite(length)) throw InvalidInput("a normal has no direction");
        mesh.normals.col(p) /= length;
    }
}

void take_triangles(PolyData& mesh, const std::vector<std::vector<int>>& polygons) {
    mesh.triangles.resize(3, static_cast<Eigen::Index>(polygons.size()));
    Eigen::Index count = 0;
    for (const std::vector<int>& polygon : polygons)
        if (polygon.size() == 3) mesh.triangles.col(count++) = Eigen::Vector3i(polygon[0], polygon[1], polygon[2]);
    mesh.triangles.conservativeResize(3, count);
}

}  // namespace

PolyData read_mesh(ByteView content) {
    constexpr double most_mm = 1e5;
    Reader reader(content);
    if (reader.left() < header_of_mesh) throw BadMessage("a mesh has a header of 40 bytes");
    const std::uint32_t points = reader.u32();
    CellCount counts[4];  // vertices, lines, polygons, strips
    for (CellCount& count : counts) count = {reader.u32(), reader.u32()};
    const std::uint32_t arrays = reader.u32();
    if (points > reader.left() / 12) throw BadMessage("a mesh has more points than bytes for them");
    PolyData mesh;
    mesh.points.resize(3, points);
    for (std::uint32_t p = 0; p < points; ++p) {
        const double x = reader.f32(), y = reader.f32(), z = reader.f32();
        mesh.points.col(p) = Vector3d(-x, -y, z);
    }
    read_cells(reader, counts[0], points);
    mesh.lines = read_cells(reader, counts[1], points);
    const std::vector<std::vector<int>> polygons = read_cells(reader, counts[2], points);
    read_cells(reader, counts[3], points);
    read_arrays(reader, arrays, mesh);
    if (reader.left() > 0) throw BadMessage("a mesh ends before its bytes do");
    if (points > 0 && !(mesh.points.cwiseAbs().maxCoeff() <= most_mm && mesh.points.allFinite()))
        throw InvalidInput("points of the mesh lie nowhere: their coordinates are no numbers of mm");
    take_normals(mesh);
    take_triangles(mesh, polygons);
    return mesh;
}

namespace {

void write_header(Writer& writer, const PolyData& mesh) {
    std::size_t line_bytes = 0;
    for (const std::vector<int>& line : mesh.lines) line_bytes += 4 * (line.size() + 1);
    const auto u32 = [&](std::size_t value) { writer.u32(static_cast<std::uint32_t>(value)); };
    const auto triangles = static_cast<std::size_t>(mesh.triangles.cols());
    for (const std::size_t number : {static_cast<std::size_t>(mesh.points.cols()), std::size_t{0}, std::size_t{0},
                                     mesh.lines.size(), line_bytes, triangles, 16 * triangles, std::size_t{0},
                                     std::size_t{0}, mesh.point_arrays.size() + (mesh.normals.cols() > 0 ? 1 : 0)})
        u32(number);
}

void write_arrays(Writer& writer, const PolyData& mesh) {
    const bool normals = mesh.normals.cols() > 0;
    const auto head = [&](std::uint8_t type, std::uint8_t components, Eigen::Index count) {
        writer.u8(type);
        writer.u8(components);
        writer.u32(static_cast<std::uint32_t>(count));
    };
    for (const PointArray& array : mesh.point_arrays) head(point_scalar, 1, array.values.size());
    if (normals) head(point_normal, 3, mesh.normals.cols());
    std::string names;
    for (const PointArray& array : mesh.point_arrays) names += array.name + '\0';
    if (normals) names += std::string("normals") + '\0';
    writer.text(names, names.size() + names.size() % 2);
    for (const PointArray& array : mesh.point_arrays)
        for (const double value : array.values) writer.f32(value);
    for (Eigen::Index p = 0; p < mesh.normals.cols(); ++p) {
        writer.f32(-mesh.normals(0, p));
        writer.f32(-mesh.normals(1, p));
        writer.f32(mesh.normals(2, p));
    }
}

}  // namespace

Bytes encode(const PolyData& mesh) {
    Writer writer;
    write_header(writer, mesh);
    for (Eigen::Index p = 0; p < mesh.points.cols(); ++p) {
        writer.f32(-mesh.points(0, p));
        writer.f32(-mesh.points(1, p));
        writer.f32(mesh.points(2, p));
    }
    for (const std::vector<int>& line : mesh.lines) {
        writer.u32(static_cast<std::uint32_t>(line.size()));
        for (const int point : line) writer.u32(static_cast<std::uint32_t>(point));
    }
    for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
        writer.u32(3);
        for (int corner = 0; corner < 3; ++corner) writer.u32(static_cast<std::uint32_t>(mesh.triangles(corner, t)));
    }
    write_arrays(writer, mesh);
    return std::move(writer.bytes());
}

}  // namespace tissuewarp::server
