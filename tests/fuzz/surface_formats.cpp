// Surfaces: PLY, STL, OBJ, VTK legacy and XML polydata, in text and in bytes.

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "registration/io/surface_points.hpp"
#include "tests/fuzz/appended_fields.hpp"
#include "tests/fuzz/format.hpp"

#include <cstdlib>

namespace tissuewarp::fuzz {

namespace {

meshing::SurfaceMesh ball() {
    return meshing::boundary_surface(meshing::box_mesh({30, 20, 20}, {2, 2, 1})).surface;
}

Seed written(const std::string& name, const std::filesystem::path& folder) {
    meshing::write_surface(ball(), folder / name);
    return single(name, bytes_at(folder / name));
}

void read_surface(const std::filesystem::path& path, Digest& digest) {
    const meshing::Surface surface = meshing::read_surface(path);
    digest.matrix(surface.mesh.nodes);
    digest.matrix(surface.mesh.triangles);
    digest.matrix(surface.normals);
    try {
        digest.matrix(registration::read_surface_points(path).points);
    } catch (const InvalidInput&) {  // too small, …
    }
}

void read_lines(const std::filesystem::path& path, Digest& digest) {
    const meshing::Polylines read = meshing::read_polylines(path);
    digest.matrix(read.nodes);
    for (const std::vector<int>& line : read.lines)
        digest.matrix(Eigen::VectorXi::Map(line.data(), static_cast<Eigen::Index>(line.size())));
}

void read_polydata(const std::filesystem::path& path, Digest& digest) {
    read_surface(path, digest);
    read_lines(path, digest);
}

std::vector<Seed> ply_seeds(const std::filesystem::path& folder) {
    return {written("w.ply", folder),
            single("a.ply",
                   "ply\nformat ascii 1.0\ncomment SPACE=RAS\nelement vertex 4\nproperty float x\n"
                   "property float y\nproperty float z\nproperty float nx\nproperty float ny\n"
                   "property float nz\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
                   "0 0 0 0 0 1\n10 0 0 0 0 1\n0 10 0 0 0 1\n0 0 10 1 0 0\n3 0 1 2\n4 0 1 2 3\n"),
            single("b.ply", std::string("ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\n"
                                        "property double y\nproperty double z\nproperty uchar red\nend_header\n") +
                                std::string(75, '\0'))};
}

std::vector<Seed> stl_seeds(const std::filesystem::path& folder) {
    return {written("w.stl", folder),
            single("a.stl",
                   "solid SPACE=LPS\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 10 0 0\n"
                   "vertex 0 10 0\nendloop\nendfacet\nfacet normal 1 0 0\nouter loop\nvertex 0 0 0\n"
                   "vertex 0 10 0\nvertex 0 0 1e1\nendloop\nendfacet\nendsolid\n")};
}

std::vector<Seed> obj_seeds(const std::filesystem::path& folder) {
    return {written("w.obj", folder),
            single("a.obj",
                   "# SPACE=RAS\nmtllib a.mtl\nv 0 0 0\nv 10 0 0 1.0\nv 0 10 0\nv 0 0 10\nvn 0 0 1\nvt 0 0\n"
                   "f 1/1/1 2/1/1 3/1/1\nf 1 2 3 4\nf -4 -3 -2\n")};
}

std::vector<Seed> vtk_seeds(const std::filesystem::path& folder) {
    const std::string points = "POINTS 4 float\n0 0 0 10 0 0\n0 10 0 0 0 10\n";
    return {written("w.vtk", folder),
            single("a.vtk",
                   "# vtk DataFile Version 3.0\nSPACE=LPS\nASCII\nDATASET POLYDATA\nFIELD FieldData 2\n"
                   "SPACE 1 1 string\nLPS\nweights 1 3 double\n1 2 3\n" +
                       points + "LINES 2 7\n3 0 1 2\n2 2 3\nPOLYGONS 2 8\n3 0 1 2\n3 0 2 3\n" +
                       "POINT_DATA 4\nNORMALS Normals float\n0 0 1 0 0 1 0 0 1 0 0 1\n"),
            single("n.vtk", "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET POLYDATA\n" + points +
                                "METADATA\nINFORMATION 1\nNAME L2 LOCATION vtk\nDATA 2 0 1\n\nVERTICES 2 1\n"
                                "OFFSETS vtktypeint64\n0 1\nCONNECTIVITY vtktypeint64\n0\nLINES 3 5\n"
                                "OFFSETS vtktypeint64\n0 3 5\nCONNECTIVITY vtktypeint64\n0 1 2 2 3\nPOLYGONS 2 3\n"
                                "OFFSETS vtktypeint64\n0 3\nCONNECTIVITY vtktypeint64\n0 1 2\n")};
}

std::vector<Seed> vtp_seeds(const std::filesystem::path& folder) {
    const auto array = [](const std::string& type, const std::string& name, int components, const std::string& values) {
        return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
               std::to_string(components) + "\" format=\"ascii\">" + values + "</DataArray>\n";
    };
    return {written("w.vtp", folder),
            single("a.vtp",
                   "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
                   "byte_order=\"LittleEndian\">\n<PolyData>\n<Piece NumberOfPoints=\"4\" NumberOfVerts=\"0\" "
                   "NumberOfLines=\"2\" NumberOfStrips=\"0\" NumberOfPolys=\"1\">\n<PointData "
                   "Normals=\"Normals\">\n" +
                       array("Float32", "Normals", 3, "0 0 1 0 0 1 0 0 1 0 0 1") + "</PointData>\n<Points>\n" +
                       array("Float32", "Points", 3, "0 0 0 10 0 0 0 10 0 0 0 10") + "</Points>\n<Lines>\n" +
                       array("Int64", "connectivity", 1, "0 1 2 2 3") + array("Int64", "offsets", 1, "3 5") +
                       "</Lines>\n<Polys>\n" + array("Int64", "connectivity", 1, "0 1 2") +
                       array("Int64", "offsets", 1, "3") + "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n")};
}

std::vector<Field> stl_fields(const std::string& bytes) {
    std::vector<Field> fields{{80, 4, false}};
    for (std::size_t at = 84; at + 50 <= bytes.size(); at += 50) fields.push_back({at + 12, 4, true});
    return fields;
}

}  // namespace

std::vector<Field> appended_fields(const std::string& bytes) {
    std::vector<Field> fields;
    const std::size_t section = bytes.find("<AppendedData");
    const std::size_t begin = section == std::string::npos ? section : bytes.find('_', section);
    if (begin == std::string::npos) return fields;
    for (std::size_t at = 0; (at = bytes.find("offset=\"", at)) < section; at += 8) {
        const std::size_t offset = begin + 1 + std::strtoull(bytes.c_str() + at + 8, nullptr, 10);
        for (const std::size_t place : {0, 8, 16, 24, 32}) fields.push_back({offset + place, 8, place >= 8});
        for (const std::size_t place : {0, 8, 16, 24}) fields.push_back({offset + place, 8, false});
    }
    return fields;
}

std::vector<Format> surface_formats() {
    return {{"ply", ply_seeds, read_surface},
            {"stl", stl_seeds, read_surface, stl_fields},
            {"obj", obj_seeds, read_surface},
            {"vtk", vtk_seeds, read_polydata},
            {"vtp", vtp_seeds, read_polydata, appended_fields}};
}

}  // namespace tissuewarp::fuzz
