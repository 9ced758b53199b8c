/// Files of centre lines, tangents along them, and curves that cannot be used.
#include "registration/io/curves.hpp"

#include "core/errors.hpp"
#include "tests/support/folders.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <filesystem>
#include <fstream>

namespace tissuewarp::registration {
namespace {

namespace fs = std::filesystem;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using tissuewarp::test::TemporaryFolder;

class CurveFiles : public ::testing::Test {
protected:
    const TemporaryFolder folder;

    fs::path written(const std::string& name, const std::string& text) const { return folder.written(name, text); }
    std::string complaint(const fs::path& moving, const fs::path& fixed) const {
        try {
            read_curves(moving, fixed);
        } catch (const std::runtime_error& problem) {
            return problem.what();
        }
        return "";
    }
    /// Two lines of six points 4 mm apart, along x and along y.
    fs::path good_table(const std::string& name, double unit = 1) const {
        std::string text = "line,x,y,z\n";
        for (int n = 0; n < 6; ++n)
            for (const bool first : {true, false})
                text += std::string(first ? "a" : "b") + "," + std::to_string((first ? 4 * n : 0) / unit) + "," +
                        std::to_string((first ? 0 : 4 * n) / unit) + "," + std::to_string(7 / unit) + "\n";
        return written(name, text);
    }
    static constexpr const char* vtk_header = "# vtk DataFile Version 3.0\nlines SPACE=LPS\nASCII\nDATASET POLYDATA\n";
};

TEST_F(CurveFiles, TablesOfLinesAndOfPoints) {
    const fs::path lines = good_table("lines.csv");
    const fs::path points = written("points.csv", "x,y,z\n1,2,3\n9,2,3\n1,12,3\n1,2,13\n7,7,7\n");
    const Curves loose = read_curves(lines, points, 0.4);
    ASSERT_EQ(loose.moving.size(), 2u);
    EXPECT_EQ(loose.moving[1].cols(), 6);
    EXPECT_NEAR((loose.moving[1].col(5) - Vector3d(0, 20, 7)).norm(), 0, 1e-9);
    EXPECT_EQ(loose.fixed.cols(), 5);
    EXPECT_EQ(loose.tangents.norm(), 0);  // not known
    EXPECT_EQ(loose.deviation_mm, 0.4);
    const Curves joined = read_curves(lines, lines, 0.4);
    ASSERT_EQ(joined.tangents.cols(), 12);
    for (Eigen::Index n = 0; n < 12; ++n)  // rows of both lines by turns
        EXPECT_NEAR((joined.tangents.col(n) - Vector3d::Unit(n % 2)).norm(), 0, 1e-9) << n;
}

TEST_F(CurveFiles, PolydataOfBothVersions) {
    const std::string points = "POINTS 6 float\n0 0 0 5 0 0 10 0 0 10 5 0 10 10 0 30 30 30\n";
    const fs::path old = written("old.vtk", vtk_header + points + "LINES 2 7\n3 0 1 2\n2 2 4\n");
    const fs::path modern =
        written("new.vtk",
                vtk_header + points + "LINES 3 5\nOFFSETS vtktypeint64\n0 3 5\nCONNECTIVITY vtktypeint64\n0 1 2 2 4\n");
    for (const fs::path& path : {old, modern}) {
        const Curves curves = read_curves(path, path);
        ASSERT_EQ(curves.moving.size(), 2u) << path;
        EXPECT_NEAR((curves.moving[1].col(1) - Vector3d(10, 10, 0)).norm(), 0, 1e-6) << path;
        EXPECT_EQ(curves.fixed.cols(), 6) << path;
        EXPECT_NEAR(curves.tangents.col(1)[0], 1, 1e-6) << path;
        EXPECT_EQ(curves.tangents.col(5).norm(), 0) << path;  // on no line
    }
}

TEST_F(CurveFiles, XmlPolydataAsVtkWritesIt) {
    const fs::path path = tissuewarp::test::source_folder() / "tests/meshing/vtp/raw-zlib-32.vtp";
    const Curves curves = read_curves(path, path);
    ASSERT_EQ(curves.moving.size(), 2u);
    EXPECT_EQ(curves.moving[1].col(1), Vector3d(10, 10, -0.125));
    EXPECT_EQ(curves.fixed.cols(), 6);
    EXPECT_GT(curves.tangents.col(1)[0], 0.999);
    EXPECT_EQ(curves.tangents.col(5).norm(), 0);  // on no line
}

TEST_F(CurveFiles, CurvesOfSlicerInTheSystemThatTheySay) {
    const auto list = [](const std::string& type, const std::vector<std::string>& positions) {
        std::string text =
            R"({"coordinateSystem": "RAS", "coordinateUnits": "mm", "type": ")" + type + R"(", "controlPoints": [)";
        for (const std::string& position : positions)
            text += (&position == &positions.front() ? "" : ", ") + (R"({"position": [)" + position + "]}");
        return text + "]}";
    };
    const std::string curve = list("Curve", {"0, 0, 7", "-4, 0, 7", "-8, 0, 7", "-12, 0, 7"}),
                      ring = list("ClosedCurve", {"0, -20, 0", "0, -24, 0", "0, -24, 4"}),
                      loose = list("Fiducial", {"-1, -2, 3", "-30, -2, 3"});
    const fs::path file = written("lines.mrk.json", R"({"markups": [)" + loose + ", " + curve + ", " + ring + "]}");
    const Curves curves = read_curves(file, file);
    ASSERT_EQ(curves.moving.size(), 2u);
    EXPECT_EQ(curves.moving[0].col(3), Vector3d(12, 0, 7));
    ASSERT_EQ(curves.moving[1].cols(), 4);
    EXPECT_EQ(curves.moving[1].col(3), Vector3d(0, 20, 0));
    EXPECT_EQ(curves.fixed.cols(), 9);
    EXPECT_EQ(curves.tangents.col(0).norm(), 0);  // on no line
    EXPECT_NEAR(curves.tangents.col(3)[0], 1, 1e-9);
    const fs::path points = written("points.mrk.json", R"({"markups": [)" + loose + "]}");
    EXPECT_NE(complaint(points, file).find("points.mrk.json: holds no line"), std::string::npos);
}

TEST_F(CurveFiles, HostileFilesAreRefusedByName) {
    const fs::path good = good_table("good.csv");
    ASSERT_EQ(complaint(good, good), "");
    const std::string points = "POINTS 2 float\n0 0 0 50 0 0\n";
    const std::vector<std::pair<fs::path, std::string>> bad{
        {written("empty.csv", ""), "empty.csv"},
        {written("header.csv", "1,2,3,0\n4,5,6,0\n"), "4 columns without a header"},
        {written("nan.csv", "x,y,z,line\n1,2,3,0\nnan,2,3,0\n"), "nan.csv:3"},
        {written("fields.csv", "x,y,z,line\n1,2,3,0\n1,2,3\n"), "fields.csv:3"},
        {written("points.csv", "x,y,z\n1,2,3\n40,50,60\n"), "holds no line"},
        {good_table("metres.csv", 1000), "metres"},
        {written("lines.ply", "ply\n"), ".vtk"},
        {written("index.vtk", vtk_header + points + "LINES 1 3\n2 0 2\n"), "uses point 2"},
        {written("count.vtk", vtk_header + points + "LINES 99999999 3\n2 0 1\n"), "more than the file can hold"},
        {written("one.vtk", vtk_header + points + "LINES 1 2\n1 0\n"), "fewer than two points"},
        {written("index.vtp",
                 "<VTKFile type='PolyData'><Piece NumberOfPoints='1'><Points><DataArray format='ascii'>0 0"
                 "</DataArray></Points></Piece></VTKFile>"),
         "index.vtp' has 2 values in Points/; 3 are needed"},
        {written("las.vtk", "# vtk DataFile Version 3.0\nSPACE=LAS\nASCII\nDATASET POLYDATA\n" + points), "LAS"},
    };
    for (const auto& [path, words] : bad)
        EXPECT_NE(complaint(path, good).find(words), std::string::npos) << path << ": " << complaint(path, good);
    EXPECT_NE(complaint(good, written("few.csv", "x,y,z\n1,2,3\n40,50,60\n")).find("at least 5"), std::string::npos);
}

TEST(Curves, TangentsAreChordsOfAHelix) {
    const double radius = 12, pitch = 3;
    Matrix3Xd line(3, 200);
    for (Eigen::Index n = 0; n < line.cols(); ++n)
        line.col(n) = Vector3d(radius * std::cos(0.05 * double(n)), radius * std::sin(0.05 * double(n)),
                               pitch * 0.05 * double(n));
    const Matrix3Xd tangents = tangents_along(line, 3);
    for (Eigen::Index n = 10; n < 190; ++n) {
        const double angle = 0.05 * double(n);
        const Vector3d exact = Vector3d(-radius * std::sin(angle), radius * std::cos(angle), pitch).normalized();
        EXPECT_GT(exact.dot(tangents.col(n)), std::cos(2 * EIGEN_PI / 180)) << n;
    }
    EXPECT_NEAR(tangents.col(0).norm(), 1, 1e-9);
    EXPECT_EQ(tangents_along(line.leftCols(5), 3).norm(), 0);  // 2.5 mm: too short to say
}

TEST(Curves, WhatCannotBeUsedIsRefused) {
    Curves good;
    good.moving = {Matrix3Xd(3, 2)};
    good.moving[0] << 0, 40, 0, 10, 0, 0;
    good.fixed = Matrix3Xd::Random(3, 20) * 30;
    good.tangents = Matrix3Xd::Zero(3, 20);
    EXPECT_NO_THROW(require_usable(good));
    std::vector<Curves> bad(9, good);
    bad[0].moving.clear();
    bad[1].moving[0](1, 1) = NAN;
    bad[2].moving.emplace_back(3, 1);
    bad[3].fixed(2, 7) = INFINITY;
    bad[4].fixed.resize(3, 4);
    bad[5].tangents(0, 3) = 0.5;
    bad[6].deviation_mm = -1;
    bad[7].fixed *= 1e-3;
    bad[8].moving[0] = Matrix3Xd(3, 4000);  // back and forth
    for (Eigen::Index n = 0; n < 4000; ++n) bad[8].moving[0].col(n) = Vector3d(n % 2 ? 50 : 0, 0, 0);
    for (std::size_t n = 0; n < bad.size(); ++n) EXPECT_THROW(require_usable(bad[n]), InvalidInput) << n;
}

}  // namespace
}  // namespace tissuewarp::registration
