/// Tables of points as programs and people write them: read as they mean it, or refused with the line.
#include "meshing/point_table.hpp"

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "scratch_folder.hpp"
#include "tests/support/noted.hpp"

#include <gmock/gmock.h>

namespace tissuewarp::meshing {
namespace {

using ::testing::HasSubstr;

class PointTables : public ScratchFolder {
protected:
    [[nodiscard]] PointTable read(const std::string& text) const { return read_point_table(file("a.csv", text)); }
    [[nodiscard]] std::string refused(const std::string& text) const {
        try {
            (void)read(text);
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "accepted";
    }
    [[nodiscard]] std::string noted(const std::string& text) const {
        std::string all;
        for (const std::string& note : read(text).notes) all += note;
        return all;
    }
    const Eigen::Vector3d first{-5.5, 49.03, 12}, second{25, -19, 3};
};

TEST_F(PointTables, SeparatorsDecimalMarksAndLineEndsAreTold) {
    for (const std::string text : {
             "x,y,z\n-5.5,49.03,12\n25,-19,3\n",
             "x;y;z\n-5,5;49,03;12\n25;-19;3\n",
             "x;y;z\r\n-5.5;49.03;12\r\n25;-19;3",
             "x\ty\tz\n-5,5\t49,03\t12\n25\t-19\t3\n",
             "\xEF\xBB\xBF\"x\",\"y\",\"z\"\r-5.5,49.03,12\r25,-19,3\r",
             "\"x\",\"y\",\"z\"\n\"-5,5\",\"49,03\",\"12\"\n\"25\",\"-19\",\"3\"\n",
             "sep=;\nx;y;z\n-5,5;49,03;12\n25;-19;3\n;;\n",
             "-5,5 49,03 12,0\n25,0 -19,0 3,0\n",
             "-5.5   49.03\t12\n  25 -19 3  \n",
             "-5.5, 49.03, 12,\n25, -19, 3,\n",
             "\xE2\x88\x92"
             "5.5;49.03;1.2e1\n+25;-19;3\n",
         }) {
        const Eigen::Matrix3Xd points = read(text).points;
        ASSERT_EQ(points.cols(), 2) << text;
        EXPECT_EQ(points.col(0), first) << text;
        EXPECT_EQ(points.col(1), second) << text;
    }
    EXPECT_THAT(noted("x;y;z\n-5,5;49,03;12\n"), HasSubstr("a.csv': its numbers have decimal commas"));
}

/// A field of quotation marks alone once took a time with the square of its length.
TEST_F(PointTables, AnyNumberOfQuotationMarksIsReadInTime) {
    const PointTable table = read("x,y,z,name\n-5.5,49.03,12,\"" + std::string(8'000'000, '"') + "\"\n");
    ASSERT_EQ(table.points.cols(), 1);
    EXPECT_EQ(table.points.col(0), first);
}

TEST_F(PointTables, TheHeaderIsObeyed) {
    for (const std::string text : {
             "z,y,x\n12,49.03,-5.5\n3,-19,25\n",
             "name,Z,X,Y\na,12,-5.5,49.03\nb,3,25,-19\n",
             "r,a,s\n5.5,-49.03,12\n-25,19,3\n",
             "S,A,R\n12,-49.03,5.5\n3,19,-25\n",
             "L;P;S\n-5,5;49,03;12\n25;-19;3\n",
             "Left,Anterior,Inferior\n-5.5,-49.03,-12\n25,19,-3\n",
             "x_ras,y_ras,z_ras\n5.5,-49.03,12\n-25,19,3\n",
             "\"Points:2\",\"Points:0\",\"Points:1\"\n12,-5.5,49.03\n3,25,-19\n",
             "x (mm),y (mm),z (mm)\n-5.5,49.03,12\n25,-19,3\n",
             "x,y,z,r,g,b\n-5.5,49.03,12,120,130,140\n25,-19,3,1,2,3\n",
             "# z y x\n12 49.03 -5.5\n3 -19 25\n",
             "//X Y Z R G B\n-5.5 49.03 12 120 130 140\n25 -19 3 1 2 3\n",
             "# CoordinateSystem = RAS\nx,y,z\n5.5,-49.03,12\n-25,19,3\n",
         }) {
        const PointTable table = read(text);
        ASSERT_EQ(table.points.cols(), 2) << text;
        EXPECT_EQ(table.points.col(0), first) << text;
        EXPECT_EQ(table.points.col(1), second) << text;
        EXPECT_EQ(table.normals.cols(), 0) << text;
    }
    EXPECT_THAT(noted("s,a,r\n1,2,3\n"), HasSubstr("the columns r, a, s were turned to LPS"));
    EXPECT_THAT(noted("# SPACE=RAS\n1,2,3\n"), HasSubstr("RAS; they were turned to LPS"));
}

TEST_F(PointTables, NormalsAreUnitOrNamed) {
    EXPECT_EQ(read("1 2 3 0 0 -1\n1 2 3 0.6 0.8 0\n4 5 6 0 0 0\n").normals.col(1), Eigen::Vector3d(0.6, 0.8, 0));
    EXPECT_EQ(read("nz,ny,nx,z,y,x\n-2,0,0,3,2,1\n").normals.col(0), Eigen::Vector3d(0, 0, -1));
    EXPECT_EQ(read("r,a,s,nx,ny,nz\n1,2,3,1,0,0\n").normals.col(0), Eigen::Vector3d(-1, 0, 0));
    EXPECT_THAT(refused("-5.5 49.03 12 120 130 140\n"),
                ::testing::AllOf(HasSubstr("a.csv:1: columns 4 to 6 (120, 130, 140)"), HasSubstr("x,y,z,r,g,b")));
    EXPECT_THAT(refused("1 2 3 0 0 1\n1 2 3 0.4 0.5 0.6\n"), HasSubstr("a.csv:2: columns 4 to 6"));
}

TEST_F(PointTables, WhatCannotBeToldIsRefusedWithItsLine) {
    EXPECT_THAT(refused(""), HasSubstr("the file is empty"));
    EXPECT_THAT(refused("x,y,z\n"), HasSubstr("holds no point"));
    EXPECT_THAT(refused("x,y,z\n1,2,3\n1,2\n"), HasSubstr("a.csv:3: 2 fields; the header names 3"));
    EXPECT_THAT(refused("1 2 3\n\n1 2 3 4\n"), HasSubstr("a.csv:3: 4 fields; the first row has 3"));
    EXPECT_THAT(refused("x,y,z\n-5,77,49,03,12,00\n"), HasSubstr("a.csv:2: 6 fields; the header names 3; separate "
                                                                 "columns with decimal commas by semicolons"));
    EXPECT_THAT(refused("-5,77,49,03,12,00\n"), HasSubstr("a.csv:1: commas stand between columns and for decimal"));
    EXPECT_THAT(refused("My points\nx,y,z\n1,2,3\n"), HasSubstr("a.csv:1: this line stands before the names"));
    EXPECT_THAT(refused("//X Y Z\n3\n1 2 3\n4 5 6\n"),
                HasSubstr("a.csv:2: '3' looks like the number of points, and 2"));
    EXPECT_THAT(refused("2\nmolecule\nC 1 2 3\nH 4 5 6\n"), HasSubstr("a.csv:1: '2' looks like the number of points"));
    EXPECT_THAT(refused("x,y,z\n1,2,3\n,,\n4,5,6\n"), HasSubstr("a.csv:3: the row is empty and others follow"));
    EXPECT_THAT(refused("x\ty\tz\n1\t2\t3\n\t\t\n4\t5\t6\n"), HasSubstr("a.csv:3: the row is empty"));
    EXPECT_THAT(refused("x,y,z\n,,\n4,5,6\n"), HasSubstr("a.csv:2: the row is empty"));
    EXPECT_THAT(refused("x,y,z\n1,nan,3\n"), HasSubstr("a.csv:2: y is nan"));
    EXPECT_THAT(refused("nan,2,3\n"), HasSubstr("a.csv:1: x is nan"));
    EXPECT_THAT(refused("x,y,z\n1,2,1e7\n"), HasSubstr("a.csv:2: z is 1e7; a finite coordinate"));
    EXPECT_THAT(refused("x;y;z\n1,5;2.5;3\n"), HasSubstr("a.csv:2: '2.5': the file has decimal commas and"));
    EXPECT_THAT(refused("x;y;z\n1.234,5;2;3\n"), HasSubstr("a.csv:2: x is '1.234,5'"));
    EXPECT_THAT(refused("i,j,k\n1,2,3\n"), HasSubstr("a.csv:1: the header 'i, j, k' does not say"));
    EXPECT_THAT(refused("x,y\n1,2\n"), HasSubstr("a.csv:1: the header 'x, y' does not say"));
    EXPECT_THAT(refused("x,y,z,X\n1,2,3,4\n"), HasSubstr("two columns for x"));
    EXPECT_THAT(refused("x_cm,y_cm,z_cm\n1,2,3\n"), HasSubstr("a.csv:1: the column 'x_cm' is in cm"));
    EXPECT_THAT(refused("tip,1,2,3\n"), HasSubstr("4 columns without a header"));
    EXPECT_THAT(refused("# RAS or LPS?\n1,2,3\n"), HasSubstr("a.csv:1: the remarks name both RAS and LPS"));
    EXPECT_THAT(refused(std::string("x,y,z\n1,2,\0\n", 13)), HasSubstr("is no text"));
    EXPECT_THAT(refused("\xFF\xFEx"), HasSubstr("UTF-16"));
    EXPECT_THROW((void)read_point_table(file("absent.csv")), IoError);
}

TEST_F(PointTables, RemarksSayTheFrameInAnyCaseAndInWords) {
    const Eigen::Vector3d turned(-1, -2, 3), kept(1, 2, 3);
    for (const std::string remark : {"coordinate system: ras", "space: right-anterior-superior", "Frame = Ras",
                                     "CoordinateSystem = RAS+", "Right Anterior Superior"}) {
        EXPECT_EQ(read("# " + remark + "\nx,y,z\n1,2,3\n").points, turned) << remark;
        EXPECT_THAT(noted("# " + remark + "\nx,y,z\n1,2,3\n"), HasSubstr("says that its points are RAS")) << remark;
    }
    for (const std::string remark : {"of brain_ras.nii.gz", "space: lps", "units: mm", "unit normals in m", "las"})
        EXPECT_EQ(read("# " + remark + "\nx,y,z\n1,2,3\n").points, kept) << remark;
    EXPECT_THAT(refused("# space: LAS\nx,y,z\n1,2,3\n"),
                HasSubstr("a.csv:1: says that its points are in the frame LAS"));
}

TEST_F(PointTables, RemarksThatSayAnotherUnitAreRefused) {
    EXPECT_THAT(refused("# units: cm\nx,y,z\n1,2,3\n"), HasSubstr("a.csv:1: says that its unit is cm"));
    EXPECT_THAT(refused("# Unit of length is \xC2\xB5m\n1,2,3\n"), HasSubstr("its unit is \xC2\xB5m"));
}

TEST_F(PointTables, NamesStandInSeveralColumns) {
    for (const std::string column : {"ID", "id", "Point", "landmark", "Name", "LABEL"})
        EXPECT_EQ(read(column + ",x,y,z\nF-1,1,2,3\n").names, std::vector<std::string>{"F-1"}) << column;
    EXPECT_EQ(read("id,label,x,y,z\n7,tip,1,2,3\n").names, std::vector<std::string>{"tip"});
    EXPECT_TRUE(read("id,x,y,z\n1,1,2,3\n2,4,5,6\n").names_count_rows);
    EXPECT_FALSE(read("id,x,y,z\n2,1,2,3\n1,4,5,6\n").names_count_rows);
}

TEST_F(PointTables, PointsThatDoNotCountAreSaidInNumbersOrWords) {
    for (const std::string no : {"0", "0.0", "False", "NO"})
        for (const std::string yes : {"1", "1.0", "True", "yes"}) {
            const std::string text = "label,x,y,z,defined\na,1,2,3," + no + "\nb,4,5,6," + yes + "\n";
            EXPECT_EQ(read(text).points, Eigen::Vector3d(4, 5, 6)) << text;
            EXPECT_THAT(noted(text), HasSubstr("left out: a")) << text;
        }
    EXPECT_THAT(refused("x,y,z,visible\n1,2,3,maybe\n"), HasSubstr("a.csv:2: 'maybe' does not say whether"));
}

TEST_F(PointTables, FirstRowsThatAreNoPointsAreTold) {
    EXPECT_EQ(read("0,1,2\n4,5,6\n").points, Eigen::Vector3d(4, 5, 6));
    EXPECT_THAT(noted("0,1,2\n4,5,6\n"), HasSubstr("line 1 numbers the columns and is no point"));
    EXPECT_EQ(read("0,1,2\n").points, Eigen::Vector3d(0, 1, 2));
    EXPECT_EQ(read("2\n1,2,3\n4,5,6\n").points.col(1), Eigen::Vector3d(4, 5, 6));
    EXPECT_EQ(read("#z y x\n1\n1 2 3\n").points, Eigen::Vector3d(3, 2, 1));
    EXPECT_THAT(noted("1\n1 2 3\n"), HasSubstr("its first row, 1, is the number of points that follow"));
}

TEST_F(PointTables, AnEmptyLineBetweenPointsWithoutNamesIsNoted) {
    EXPECT_THAT(noted("x,y,z\n1,2,3\n\n4,5,6\n"), HasSubstr("line 3 is empty and others follow"));
    EXPECT_THAT(noted("x,y,z\n1,2,3\n4,5,6\n\n\n7,8,9\n"), HasSubstr("line 4 is empty"));
    EXPECT_EQ(noted("x,y,z,name\n1,2,3,a\n\n4,5,6,b\n"), "");
    EXPECT_EQ(noted("x,y,z\n\n1,2,3\n4,5,6\n\n"), "");
    EXPECT_EQ(noted("x,y,z\r\r\n1,2,3\r\r\n4,5,6\r\r\n7,8,9\r\r\n"), "");
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
}

// As 3D Slicer writes: one rule for all formats.
TEST_F(PointTables, SurfacesAreTurnedFromTheFrameThatTheyName) {
    SurfaceMesh triangle{Eigen::Matrix3Xd(3, 3), Eigen::Matrix3Xi(3, 1)};
    triangle.nodes << 1, 2, 3, 4, 6, 5, 7, 8, 10;
    triangle.triangles << 0, 1, 2;
    const Eigen::Vector3d turned = Eigen::Vector3d(-1, -1, 1).cwiseProduct(triangle.nodes.col(1));
    for (const std::string extension : {"ply", "stl", "obj", "vtk", "vtp"}) {
        const auto path = file("lps." + extension);
        write_surface(triangle, path);
        tissuewarp::test::Noted silent, said;
        EXPECT_EQ(read_surface(path, silent).mesh.nodes.col(1), Eigen::Vector3d(triangle.nodes.col(1))) << extension;
        EXPECT_EQ(silent.notes, "") << extension;
        const bool xml = extension == "vtp";
        const std::string text = bytes_of(path), ras = xml ? replaced(text, "76 80 83 0", "82 65 83 0")
                                                           : replaced(text, "SPACE=LPS", "SPACE=RAS");
        const Surface surface = read_surface(file("ras." + extension, ras), said);
        EXPECT_EQ(surface.mesh.nodes.col(1), turned) << extension;
        EXPECT_THAT(said.notes, HasSubstr("ras." + extension + "': says that its points are RAS")) << extension;
        const std::string las =
            xml ? replaced(text, "76 80 83 0", "76 65 83 0") : replaced(text, "SPACE=LPS", "space=LAS");
        EXPECT_THROW(read_surface(file("las." + extension, las)), InvalidInput) << extension;
    }
    const std::string solid =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 2 3\nvertex 0 1 0\nendloop\n"
        "endfacet\nendsolid\n";
    EXPECT_EQ(read_surface(file("a.stl", "solid 3D Slicer output. SPACE=RAS\n" + solid)).mesh.nodes.col(1),
              Eigen::Vector3d(-1, -2, 3));
    const std::string binary = std::string(80, 'x') + std::string("\1\0\0\0", 4) + std::string(50 + 50, '\0');
    try {
        (void)read_surface(file("long.stl", binary));
        ADD_FAILURE() << "accepted";
    } catch (const Error& error) {
        EXPECT_THAT(error.what(), HasSubstr("it has 184 bytes, and the 1 triangles that it states take 134"));
    }
    EXPECT_EQ(read_surface(file("b.stl", "solid color space=sRGB\n" + solid)).mesh.nodes.col(1),
              Eigen::Vector3d(1, 2, 3));
}

TEST_F(PointTables, SurfacesThatSayAnotherUnitOrHaveWeightsAreRefused) {
    const auto refusal = [&](const std::string& name, const std::string& text) -> std::string {
        try {
            (void)read_surface(file(name, text));
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "accepted";
    };
    const std::string ply =
        "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    EXPECT_THAT(refusal("a.ply", "ply\nformat ascii 1.0\ncomment units: cm\n" + ply), HasSubstr("its unit is cm"));
    EXPECT_EQ(refusal("b.ply", "ply\nformat ascii 1.0\ncomment units: mm\n" + ply), "accepted");
    EXPECT_THAT(refusal("a.obj", "# Units: inches\nv 1 2 3\n"), HasSubstr("its unit is inches"));
    EXPECT_THAT(refusal("b.obj", "v 1 2 3 2\n"), HasSubstr("the weight 2 ('v 1 2 3 2')"));
    EXPECT_EQ(refusal("c.obj", "v 1 2 3 1\nv 1 2 3 0.5 0.5 0.5\n"), "accepted");
    EXPECT_EQ(read_surface(file("d.obj", "# coordinate system: ras\nv 1 2 3\n")).mesh.nodes.col(0),
              Eigen::Vector3d(-1, -2, 3));
}

TEST_F(PointTables, FieldsOfVtkFilesStandAnywhere) {
    const std::string head = "# vtk DataFile Version 4.2\nx\nASCII\nDATASET POLYDATA\n",
                      points = "POINTS 3 float\n0 0 0 1 2 3 0 1 0\n", polygon = "POLYGONS 1 4\n3 0 1 2\n",
                      field = "FIELD FieldData 2\nTimeValue 1 1 double\n0\nname 1 1 string\nof%20tissue\n",
                      space = "FIELD FieldData 1\nSPACE 1 1 string\nRAS\n";
    for (const std::string& text :
         {head + field + points + polygon, head + points + field + polygon, head + points + polygon + field}) {
        const Surface surface = read_surface(file("a.vtk", text));
        EXPECT_EQ(surface.mesh.triangle_count(), 1) << text;
        EXPECT_EQ(surface.mesh.nodes.col(1), Eigen::Vector3d(1, 2, 3)) << text;
    }
    EXPECT_EQ(read_surface(file("b.vtk", head + space + points + polygon)).mesh.nodes.col(1),
              Eigen::Vector3d(-1, -2, 3));
    const std::string binary = replaced(head, "ASCII", "BINARY") + "FIELD FieldData 2\nt 1 1 double\n" +
                               std::string(8, '\0') + "\nSPACE 1 1 string\n\xC3RAS\n";
    const Surface surface = read_surface(file("c.vtk", binary + "POINTS 1 float\n" + std::string(12, '\0') + "\n"));
    EXPECT_EQ(surface.mesh.node_count(), 1);
    const std::string small =
        "# vtk DataFile Version 3.0\nx\nascii\ndataset polydata\npoints 3 float\n0 0 0 1 2 3 0 1 0\n"
        "polygons 1 4\n3 0 1 2\npoint_data 3\nnormals n float\n0 0 1 0 0 1 0 0 1\n";
    EXPECT_EQ(read_surface(file("small.vtk", small)).normals.cols(), 3);
    EXPECT_THROW(read_surface(file("d.vtk", head + points + "POLYGONES 1 4\n3 0 1 2\n")), IoError);
    EXPECT_THROW(read_surface(file("e.vtk", head + "FIELD f 1\na 1000000000 9 double\n" + points)), IoError);
}

}  // namespace
}  // namespace tissuewarp::meshing
