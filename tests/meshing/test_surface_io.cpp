#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "scratch_folder.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>

#include <cstdint>
#include <cstring>

namespace tissuewarp::meshing {
namespace {

using SurfaceIo = ScratchFolder;

SurfaceMesh box_surface() {
    return boundary_surface(box_mesh({3, 2, 1}, {3, 2, 2})).surface;
}

double enclosed_volume(const SurfaceMesh& surface) {
    double volume = 0.0;
    for (int t = 0; t < surface.triangle_count(); ++t) {
        const Eigen::Vector3i n = surface.triangles.col(t);
        const Eigen::Vector3d a = surface.nodes.col(n[0]), b = surface.nodes.col(n[1]), c = surface.nodes.col(n[2]);
        volume += (a.y() * b.z() - a.z() * b.y()) * c.x() / 6.0 + (a.z() * b.x() - a.x() * b.z()) * c.y() / 6.0 +
                  (a.x() * b.y() - a.y() * b.x()) * c.z() / 6.0;
    }
    return volume;
}

TEST_F(SurfaceIo, PlyObjVtkAndVtpRoundTripExactly) {
    const SurfaceMesh surface = box_surface();
    for (const char* name : {"box.ply", "box.obj", "box.vtk", "box.vtp"}) {
        write_surface(surface, file(name));
        const Surface again = read_surface(file(name));
        EXPECT_EQ(again.mesh.nodes, surface.nodes) << name;
        EXPECT_EQ(again.mesh.triangles, surface.triangles) << name;
        EXPECT_EQ(again.normals.cols(), 0) << name;
    }
}

TEST_F(SurfaceIo, StlMergesTheCornersOfNeighbours) {
    write_surface(box_surface(), file("box.stl"));
    const Surface again = read_surface(file("box.stl"));
    EXPECT_EQ(again.mesh.node_count(), box_surface().node_count());
    EXPECT_EQ(again.mesh.triangle_count(), box_surface().triangle_count());
    EXPECT_NEAR(enclosed_volume(again.mesh), 6.0, 1e-5);
}

TEST_F(SurfaceIo, ReadsAsciiStl) {
    const Surface surface = read_surface(file(
        "a.stl",
        "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
        "facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"));
    EXPECT_EQ(surface.mesh.node_count(), 4);
    EXPECT_EQ(surface.mesh.triangle_count(), 2);
}

TEST_F(SurfaceIo, ReadsAsciiPlyWithNormalsAndQuads) {
    const Surface surface = read_surface(file(
        "a.ply",
        "ply\r\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 1\n"
        "property list uchar int vertex_index\nend_header\n0 0 5 255 0 0 2\n1 0 5 255 0 0 2\n1 1 5 255 0 0 2\n"
        "0 1 5 255 0 0 2\n4 0 1 2 3\n"));
    EXPECT_EQ(surface.mesh.triangle_count(), 2);
    ASSERT_EQ(surface.normals.cols(), 4);
    EXPECT_EQ(surface.normals.col(2), Eigen::Vector3d::UnitZ());
    EXPECT_EQ(surface.mesh.nodes.col(2), Eigen::Vector3d(1, 1, 5));
}

TEST_F(SurfaceIo, ReadsObjWithTexturesNormalsAndNegativeIndices) {
    const Surface surface = read_surface(
        file("a.obj", "# x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nv 1 1 0\nf -3/1 -1/2 -2/3\n"));
    ASSERT_EQ(surface.mesh.triangle_count(), 2);
    EXPECT_EQ(surface.mesh.triangles.col(0), Eigen::Vector3i(0, 1, 2));
    EXPECT_EQ(surface.mesh.triangles.col(1), Eigen::Vector3i(1, 3, 2));
}

TEST_F(SurfaceIo, ReadsAsciiVtkWithNormalsAndOffsets) {
    const Surface legacy = read_surface(
        file("a.vtk",
             "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n"
             "3 0 1 2\nPOINT_DATA 3\nNORMALS n float\n0 0 1 0 0 1 0 0 1\n"));
    EXPECT_EQ(legacy.mesh.triangle_count(), 1);
    EXPECT_EQ(legacy.normals.cols(), 3);
    const Surface modern = read_surface(file(
        "b.vtk",
        "# vtk DataFile Version 5.1\nx\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\nMETADATA\n"
        "INFORMATION 0\n\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n0 3 6\nCONNECTIVITY vtktypeint64\n0 1 2\n1 3 2\n"));
    EXPECT_EQ(modern.mesh.triangle_count(), 2);
}

TEST_F(SurfaceIo, ReadsPointLists) {
    const Surface plain = read_surface(file("a.csv", "x,y,z\n1,2,3\n-4.5, 5e1 ,6\n"));
    EXPECT_EQ(plain.mesh.node_count(), 2);
    EXPECT_EQ(plain.mesh.nodes.col(1), Eigen::Vector3d(-4.5, 50, 6));
    EXPECT_EQ(plain.mesh.triangle_count(), 0);
    const Surface oriented = read_surface(file("a.xyz", "# LPS\n1 2 3 0 0 -1\n\n"));
    ASSERT_EQ(oriented.normals.cols(), 1);
    EXPECT_EQ(oriented.normals.col(0), Eigen::Vector3d(0, 0, -1));
}

TEST_F(SurfaceIo, ReadsTheSampleSurface) {
    const Surface surface = read_surface(tissuewarp::test::source_folder() / "data/brainshift/intraop_surface.ply");
    EXPECT_EQ(surface.mesh.node_count(), 2500);
    ASSERT_EQ(surface.normals.cols(), 2500);
    EXPECT_NEAR(surface.normals.colwise().norm().minCoeff(), 1.0, 1e-6);
}

TEST_F(SurfaceIo, RefusesHostileFiles) {
    const std::string header =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
        "float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
    EXPECT_NO_THROW(read_surface(file("good.ply", header + points + "3 0 1 2\n")));
    EXPECT_THROW(read_surface(file("index.ply", header + points + "3 0 1 3\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("minus.ply", header + points + "3 0 1 -1\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("nan.ply", header + "nan 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("short.ply", header + points)), IoError);
    EXPECT_THROW(read_surface(file("list.ply", header + points + "4000000000 0 1 2\n")), IoError);
    EXPECT_THROW(read_surface(file("huge.ply",
                                   "ply\nformat binary_little_endian 1.0\nelement vertex "
                                   "9000000000000000000\nproperty float x\nproperty float y\n"
                                   "property float z\nend_header\n1234")),
                 IoError);
    EXPECT_THROW(read_surface(file("absent.ply")), IoError);
    EXPECT_THROW(read_surface(file("a.docx", "x")), IoError);
    EXPECT_THROW(read_surface(file("a.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0")), IoError);
    EXPECT_THROW(read_surface(file("b.stl", "solid x\nvertex nan 0 0\nendsolid")), InvalidInput);
    EXPECT_THROW(read_surface(file("c.stl", std::string(90, '\xff'))), IoError);
    EXPECT_THROW(read_surface(file("a.obj", "v 0 0 0\nf 1 2 3\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("b.obj", "v 0 0\n")), IoError);
    EXPECT_THROW(read_surface(file("a.csv", "1,2\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("b.csv", "1,2,nan\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("c.csv", "x,y,z\n")), InvalidInput);
    EXPECT_THROW(read_surface(file("a.vtk",
                                   "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS "
                                   "99999999999 float\n0 0 0\n")),
                 IoError);
    EXPECT_THROW(read_surface(file("b.vtk",
                                   "# vtk DataFile Version 5.1\nx\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n"
                                   "0 0 0\nPOLYGONS 2 3\nOFFSETS vtktypeint64\n0 9\nCONNECTIVITY "
                                   "vtktypeint64\n0 0 0\n")),
                 IoError);
}

TEST_F(SurfaceIo, EveryTruncationOfABinaryFileIsAnError) {
    for (const char* name : {"box.ply", "box.stl", "box.vtk"}) {
        write_surface(box_surface(), file(name));
        const std::string whole = bytes_of(file(name));
        for (std::size_t length = 0; length + 2 < whole.size(); length += 41)
            EXPECT_THROW(read_surface(file(std::string("cut-") + name, whole.substr(0, length))), Error)
                << name << " cut to " << length;
    }
}

TEST_F(SurfaceIo, WritesNothingWhereItCannot) {
    EXPECT_THROW(write_surface(box_surface(), file("box.xyz")), IoError);
    EXPECT_THROW(write_surface(box_surface(), file("no/such/box.ply")), IoError);
}

}  // namespace
}  // namespace tissuewarp::meshing
