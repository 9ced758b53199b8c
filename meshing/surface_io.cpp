#include "core/atomic_file.hpp"
#include "core/free_text.hpp"
#include "meshing/detail/surface_formats.hpp"
#include "meshing/detail/vtk_appended.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/point_table.hpp"

#include <Eigen/Dense>

#include <cctype>
#include <charconv>
#include <cstdint>

namespace tissuewarp::meshing {

namespace {

using detail::FileReader;
using detail::RawSurface;

RawSurface read_by_extension(const std::filesystem::path& path, FileReader& file) {
    const std::string extension = detail::extension_of(path);
    if (extension == ".ply") return detail::read_ply(file);
    if (extension == ".stl") return detail::read_stl(file);
    if (extension == ".obj") return detail::read_obj(file);
    if (extension == ".vtk") return detail::read_vtk_polydata(file);
    if (extension == ".vtp") return detail::read_vtp(file);
    file.fail("has the extension '" + extension +
              "'; surfaces are read from .ply, .stl, .obj, .vtk, .vtp, .csv and .xyz");
}

/// One rule for all formats: RAS is turned to LPS and said, other frames are refused, what says nothing is LPS.
bool is_ras(const RawSurface& raw, const FileReader& file, Observer& observer) {
    if (raw.space.empty() || raw.space == "LPS") return false;
    if (raw.space != "RAS")
        file.refuse("says that its points are in the frame " + raw.space + "; write them as LPS or RAS");
    observer.note(note_of(file.path(), "says that its points are RAS; they were turned to LPS"));
    return true;
}

Eigen::Matrix3Xd checked_nodes(const RawSurface& raw, const FileReader& file) {
    if (!raw.unit.empty()) file.refuse("says that its unit is " + raw.unit + "; write coordinates in mm");
    if (raw.nodes.empty()) file.refuse("has no points; at least one is needed");
    Eigen::Matrix3Xd nodes(3, static_cast<Eigen::Index>(raw.nodes.size()));
    for (Eigen::Index n = 0; n < nodes.cols(); ++n) {
        nodes.col(n) = raw.nodes[static_cast<std::size_t>(n)];
        if (!nodes.col(n).allFinite()) file.refuse("has a coordinate that is not finite at point " + std::to_string(n));
    }
    return nodes;
}

int checked_index(long long node, Eigen::Index count, const FileReader& file) {
    if (node < 0 || node >= count)
        file.refuse("uses point " + std::to_string(node) + "; it has points 0 to " + std::to_string(count - 1));
    return static_cast<int>(node);
}

Surface checked(const RawSurface& raw, const FileReader& file, Observer& observer) {
    Surface surface;
    surface.mesh.nodes = checked_nodes(raw, file);
    const Eigen::Index count = surface.mesh.nodes.cols();
    surface.mesh.triangles.resize(3, static_cast<Eigen::Index>(raw.triangles.size()));
    for (std::size_t t = 0; t < raw.triangles.size(); ++t)
        for (int k = 0; k < 3; ++k)
            surface.mesh.triangles(k, static_cast<Eigen::Index>(t)) =
                checked_index(raw.triangles[t][static_cast<std::size_t>(k)], count, file);
    if (raw.normals.size() == raw.nodes.size()) surface.normals.resize(3, count);
    for (Eigen::Index n = 0; n < surface.normals.cols(); ++n) {
        const Eigen::Vector3d& normal = raw.normals[static_cast<std::size_t>(n)];
        if (!normal.allFinite()) file.refuse("has a normal that is not finite at point " + std::to_string(n));
        surface.normals.col(n) = normal.norm() > 0.0 ? Eigen::Vector3d(normal.normalized()) : normal;
    }
    if (is_ras(raw, file, observer))
        for (Eigen::Matrix3Xd* vectors : {&surface.mesh.nodes, &surface.normals}) vectors->topRows<2>() *= -1.0;
    return surface;
}

Surface from_table(const std::filesystem::path& path, Observer& observer) {
    PointTable table = read_point_table(path);
    for (const std::string& note : table.notes) observer.note(note);
    Surface surface;
    surface.mesh.nodes = std::move(table.points);
    surface.normals = std::move(table.normals);
    return surface;
}

template <class T>
void put(std::string& bytes, T value, bool big_endian = false) {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), &value, sizeof(T));
    if (big_endian) std::reverse(raw.begin(), raw.end());
    bytes.append(raw.data(), raw.size());
}

/// Shortest decimal form that reads back to the same number.
void put_text(std::string& text, double value) {
    std::array<char, 32> buffer;
    text.append(buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr);
}

// "SPACE=LPS" in the free text of a format is how 3D Slicer learns the frame.

std::string ply_document(const SurfaceMesh& surface) {
    std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment SPACE=LPS mm\nelement vertex " +
                        std::to_string(surface.node_count()) +
                        "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                        std::to_string(surface.triangle_count()) +
                        "\nproperty list uchar int vertex_indices\nend_header\n";
    for (double x : surface.nodes.reshaped()) put(bytes, x);
    for (int t = 0; t < surface.triangle_count(); ++t) {
        put(bytes, std::uint8_t{3});
        for (int node : surface.triangles.col(t)) put(bytes, std::int32_t{node});
    }
    return bytes;
}

std::string stl_document(const SurfaceMesh& surface) {
    std::string bytes = "tissuewarp SPACE=LPS mm";
    bytes.resize(80, ' ');
    put(bytes, static_cast<std::uint32_t>(surface.triangle_count()));
    for (int t = 0; t < surface.triangle_count(); ++t) {
        const Eigen::Vector3i nodes = surface.triangles.col(t);
        const Eigen::Vector3d a = surface.nodes.col(nodes[0]), b = surface.nodes.col(nodes[1]);
        const Eigen::Vector3d c = surface.nodes.col(nodes[2]);
        const Eigen::Vector3d cross = (b - a).cross(c - a);
        const double length = cross.norm();
        for (double x : cross) put(bytes, static_cast<float>(length > 0.0 ? x / length : 0.0));
        for (const Eigen::Vector3d& corner : {a, b, c})
            for (double x : corner) put(bytes, static_cast<float>(x));
        put(bytes, std::uint16_t{0});
    }
    return bytes;
}

std::string obj_document(const SurfaceMesh& surface) {
    std::string text = "# SPACE=LPS mm\n";
    for (int n = 0; n < surface.node_count(); ++n) {
        text += "v";
        for (double x : surface.nodes.col(n)) put_text(text += ' ', x);
        text += "\n";
    }
    for (int t = 0; t < surface.triangle_count(); ++t) {
        text += "f";
        for (int node : surface.triangles.col(t)) (text += ' ') += std::to_string(node + 1);
        text += "\n";
    }
    return text;
}

std::string vtk_document(const SurfaceMesh& surface) {
    const std::string count = std::to_string(surface.triangle_count());
    std::string bytes = "# vtk DataFile Version 3.0\ntissuewarp SPACE=LPS mm\nBINARY\nDATASET POLYDATA\nPOINTS " +
                        std::to_string(surface.node_count()) + " double\n";
    for (double x : surface.nodes.reshaped()) put(bytes, x, true);
    bytes += "\nPOLYGONS " + count + " " + std::to_string(4LL * surface.triangle_count()) + "\n";
    for (int t = 0; t < surface.triangle_count(); ++t) {
        put(bytes, std::int32_t{3}, true);
        for (int node : surface.triangles.col(t)) put(bytes, std::int32_t{node}, true);
    }
    return bytes + "\n";
}

std::string vtp_document(const SurfaceMesh& surface, const std::vector<MeshArray>& point_arrays = {}) {
    const auto count = static_cast<std::size_t>(surface.triangle_count());
    std::vector<std::int64_t> offsets(count);
    for (std::size_t t = 0; t < count; ++t) offsets[t] = 3 * static_cast<std::int64_t>(t + 1);
    const auto nodes = surface.nodes.reshaped();
    const auto corners = surface.triangles.reshaped();
    detail::VtkAppended data;
    std::string xml =
        "<?xml version=\"1.0\"?>\n"
        "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
        "<PolyData>\n<FieldData>\n<Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">"
        "76 80 83 0</Array>\n</FieldData>\n<Piece NumberOfPoints=\"" +  // LPS
        std::to_string(surface.node_count()) +
        "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" + std::to_string(count) +
        "\">\n<PointData" +
        (point_arrays.empty() ? "" : " Scalars=\"" + detail::xml_escaped(point_arrays.front().name) + "\"") + ">\n";
    xml += detail::float_arrays(data, point_arrays, surface.nodes.cols(), "nodes");
    xml += "</PointData>\n<Points>\n";
    xml += data.array("Float64", "Points", 3, std::vector<double>(nodes.begin(), nodes.end()));
    xml += "</Points>\n<Polys>\n";
    xml += data.array("Int64", "connectivity", 1, std::vector<std::int64_t>(corners.begin(), corners.end()));
    xml += data.array("Int64", "offsets", 1, offsets);
    xml += "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    return xml + data.bytes() + "\n</AppendedData>\n</VTKFile>\n";
}

std::string document(const SurfaceMesh& surface, const std::filesystem::path& path) {
    const std::string extension = detail::extension_of(path);
    if (extension == ".ply") return ply_document(surface);
    if (extension == ".stl") return stl_document(surface);
    if (extension == ".obj") return obj_document(surface);
    if (extension == ".vtk") return vtk_document(surface);
    if (extension == ".vtp") return vtp_document(surface);
    throw IoError("'" + path.string() + "' has the extension '" + extension +
                  "'; surfaces are written as .ply, .stl, .obj, .vtk or .vtp");
}

}  // namespace

std::string detail::space_in(std::string_view text) {
    const std::string lower = lower_case(text);
    for (std::size_t at = 0; (at = lower.find("space", at)) != std::string::npos; at += 5) {
        if (at > 0 && std::isalnum(static_cast<unsigned char>(lower[at - 1])) != 0) continue;
        const std::size_t sign = lower.find_first_not_of(" \t", at + 5);
        if (sign == std::string::npos || (lower[sign] != '=' && lower[sign] != ':')) continue;
        const std::size_t value = lower.find_first_not_of(" \t", sign + 1);
        if (value == std::string::npos) continue;
        std::string space = lower.substr(value, 3);
        std::transform(space.begin(), space.end(), space.begin(), [](unsigned char c) { return std::toupper(c); });
        const bool whole = value + 3 >= lower.size() || std::isalnum(static_cast<unsigned char>(lower[value + 3])) == 0;
        int axes = 0;
        for (const std::string_view axis : {"LR", "PA", "SI"}) axes += space.find_first_of(axis) != std::string::npos;
        if (whole && axes == 3) return space;
    }
    return "";
}

void detail::RawSurface::take_free_text(std::string_view text) {
    if (unit.empty()) unit = foreign_unit_in(text);
    if (space.empty()) space = space_in(text);
    const std::set<std::string> frames = frames_stated_in(text);
    if (space.empty() && !frames.empty()) space = frames.size() == 1 ? *frames.begin() : "RAS and LPS";
}

Surface read_surface(const std::filesystem::path& path, Observer& observer) {
    const std::string extension = detail::extension_of(path);
    if (extension == ".csv" || extension == ".xyz") return from_table(path, observer);
    FileReader file(path);
    return checked(read_by_extension(path, file), file, observer);
}

Polylines read_polylines(const std::filesystem::path& path, Observer& observer) {
    FileReader file(path);
    const std::string extension = detail::extension_of(path);
    if (extension != ".vtk" && extension != ".vtp")
        file.fail("has the extension '" + extension + "'; lines are read from .vtk and .vtp");
    const RawSurface raw = read_by_extension(path, file);
    Polylines result{checked_nodes(raw, file), {}};
    if (is_ras(raw, file, observer)) result.nodes.topRows<2>() *= -1.0;
    for (const std::vector<long long>& line : raw.lines) {
        if (line.size() < 2) file.refuse("has a line of fewer than two points");
        std::vector<int>& nodes = result.lines.emplace_back();
        for (const long long node : line) nodes.push_back(checked_index(node, result.nodes.cols(), file));
    }
    return result;
}

void write_surface(const SurfaceMesh& surface, const std::filesystem::path& path) {
    write_file(document(surface, path), path);
}

void write_vtp(const SurfaceMesh& surface, const std::filesystem::path& path,
               const std::vector<MeshArray>& point_arrays) {
    write_file(vtp_document(surface, point_arrays), path);
}

}  // namespace tissuewarp::meshing
