// VTK XML polydata: points, lines, polygons and normals of one piece.

#include "meshing/detail/surface_formats.hpp"
#include "meshing/detail/vtk_xml.hpp"

#include <cmath>

namespace tissuewarp::meshing::detail {

namespace {

std::vector<Eigen::Vector3d> vectors(const VtkXml& xml, const std::string& name, std::size_t count) {
    const std::vector<double> values = xml.values(name, 3 * count);
    std::vector<Eigen::Vector3d> result(count);
    for (std::size_t n = 0; n < count; ++n) result[n] = {values[3 * n], values[3 * n + 1], values[3 * n + 2]};
    return result;
}

long long integer(double value, const std::string& name, const FileReader& file) {
    constexpr double most = 9007199254740992;  // further integers are not exact
    if (!(std::abs(value) <= most) || value != std::floor(value))
        file.refuse("has " + std::to_string(value) + " in " + name + " where an integer is needed");
    return static_cast<long long>(value);
}

std::vector<std::vector<long long>> cells(const VtkXml& xml, const std::string& section, const std::string& counted,
                                          const FileReader& file) {
    const std::size_t count = xml.count(counted);
    if (count == 0) return {};
    const std::string offsets_name = section + "/offsets", nodes_name = section + "/connectivity";
    const std::vector<double> offsets = xml.values(offsets_name, count), nodes = xml.values(nodes_name);
    std::vector<std::vector<long long>> result(count);  // as many as there are offsets
    std::size_t begin = 0;
    for (std::size_t c = 0; c < count; ++c) {
        const long long end = integer(offsets[c], offsets_name, file);
        if (end < static_cast<long long>(begin) || end > static_cast<long long>(nodes.size()))
            file.fail("has the cell offset " + std::to_string(end) + " in " + offsets_name + " after " +
                      std::to_string(begin) + "; offsets ascend to at most " + std::to_string(nodes.size()));
        for (; begin < static_cast<std::size_t>(end); ++begin)
            result[c].push_back(integer(nodes[begin], nodes_name, file));
    }
    return result;
}

}  // namespace

RawSurface read_vtp(FileReader& file) {
    const VtkXml xml(file, "PolyData");
    if (xml.count("NumberOfStrips") > 0) file.fail("has triangle strips; write triangles");
    RawSurface surface;
    surface.space = space_in("SPACE=" + xml.text("FieldData/SPACE"));  // as 3D Slicer writes it
    const std::size_t points = xml.count("NumberOfPoints");
    surface.nodes = vectors(xml, "Points/", points);
    surface.lines = cells(xml, "Lines", "NumberOfLines", file);
    for (const auto& polygon : cells(xml, "Polys", "NumberOfPolys", file)) surface.add_polygon(polygon);
    const std::string active = xml.attribute("PointData", "Normals");
    const std::string normals = "PointData/" + (active.empty() ? "Normals" : active);
    if (xml.has(normals)) surface.normals = vectors(xml, normals, points);
    return surface;
}

}  // namespace tissuewarp::meshing::detail
