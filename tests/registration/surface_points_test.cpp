/// Files of surface points, and points that cannot be used.
#include "registration/io/surface_points.hpp"

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace tissuewarp::registration {
namespace {

namespace fs = std::filesystem;
using tissuewarp::test::TemporaryFolder;

class SurfacePointFiles : public ::testing::Test {
protected:
    const TemporaryFolder folder;

    fs::path written(const std::string& name, const std::string& text) const { return folder.written(name, text); }
    /// Lines of twelve points 10 mm apart on a bent sheet, in units of `unit` mm.
    static std::string sheet(double unit, const std::string& rest_of_line = "") {
        std::string text;
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 3; ++j)
                text += std::to_string(10 * i / unit) + " " + std::to_string(10 * j / unit) + " " +
                        std::to_string(i * i / unit) + rest_of_line + "\n";
        return text;
    }
    std::string complaint(const fs::path& path) const {
        try {
            read_surface_points(path);
        } catch (const InvalidInput& problem) {
            return problem.what();
        }
        return "";
    }
};

TEST_F(SurfacePointFiles, PointListsWithAndWithoutNormals) {
    const SurfacePoints bare = read_surface_points(written("a.xyz", sheet(1)), 0.4);
    EXPECT_EQ(bare.points.cols(), 12);
    EXPECT_EQ(bare.normals.cols(), 0);
    EXPECT_EQ(bare.deviation_mm, 0.4);
    EXPECT_NEAR((bare.points.col(11) - Eigen::Vector3d(30, 20, 9)).norm(), 0, 1e-6);
    const SurfacePoints with = read_surface_points(written("b.xyz", sheet(1, " 0 0 1")));
    ASSERT_EQ(with.normals.cols(), 12);
    EXPECT_NEAR((with.normals.col(3) - Eigen::Vector3d(0, 0, 1)).norm(), 0, 1e-12);
}

TEST_F(SurfacePointFiles, TrianglesGiveNormals) {
    const auto surface = meshing::boundary_surface(test::ball({5, 6, 7}, 20, 4)).surface;
    for (const char* name : {"a.ply", "a.stl", "a.obj", "a.vtk"}) {
        meshing::write_surface(surface, folder / name);
        const SurfacePoints read = read_surface_points(folder / name);
        ASSERT_EQ(read.normals.cols(), read.points.cols()) << name;
        for (Eigen::Index n = 0; n < read.points.cols(); ++n) {
            const Eigen::Vector3d outward = (read.points.col(n) - Eigen::Vector3d(5, 6, 7)).normalized();
            EXPECT_GT(outward.dot(read.normals.col(n)), 0.8) << name << ' ' << n;
        }
    }
}

TEST_F(SurfacePointFiles, MetresAndOtherUnitsAreRefusedByName) {
    const std::string metres = complaint(written("metres.xyz", sheet(1000)));
    EXPECT_NE(metres.find("metres.xyz"), std::string::npos);
    EXPECT_NE(metres.find("mm"), std::string::npos);
    EXPECT_NE(complaint(written("micrometres.xyz", sheet(0.001))), "");
}

TEST_F(SurfacePointFiles, HostileFilesAreRefused) {
    EXPECT_NE(complaint(written("few.xyz", "1 2 3\n4 5 6\n")).find("at least 10"), std::string::npos);
    EXPECT_THROW(read_surface_points(written("nan.xyz", sheet(1) + "nan 1 2\n")), std::runtime_error);
    EXPECT_THROW(read_surface_points(folder / "absent.ply"), IoError);
}

TEST(SurfacePoints, WhatCannotBeUsedIsRefused) {
    SurfacePoints surface{Eigen::Matrix3Xd::Random(3, 40) * 30, Eigen::Matrix3Xd(3, 0), 1.0};
    EXPECT_NO_THROW(require_usable(surface));
    SurfacePoints bad = surface;
    bad.points(1, 7) = NAN;
    EXPECT_THROW(require_usable(bad), InvalidInput);
    bad = surface;
    bad.normals = Eigen::Matrix3Xd::Zero(3, 39);
    EXPECT_THROW(require_usable(bad), InvalidInput);
    bad.normals = Eigen::Matrix3Xd::Zero(3, 40);
    EXPECT_THROW(require_usable(bad), InvalidInput);
    for (const double deviation : {0.0, -1.0, double(NAN), double(INFINITY)}) {
        bad = surface;
        bad.deviation_mm = deviation;
        EXPECT_THROW(require_usable(bad), InvalidInput) << deviation;
    }
}

TEST(SurfacePoints, AFewStrayPointsDoNotMakeTheUnit) {
    SurfacePoints surface{Eigen::Matrix3Xd::Random(3, 40) * 0.03, Eigen::Matrix3Xd(3, 0), 1.0};  // metres
    surface.points.col(0) << 500, 0, 0;
    EXPECT_THROW(require_usable(surface), InvalidInput);
    surface.points.rightCols(39) *= 1000;
    surface.points.col(0) << 1e5, 0, 0;
    EXPECT_NO_THROW(require_usable(surface));
}

}  // namespace
}  // namespace tissuewarp::registration
