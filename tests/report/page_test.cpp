/// The page and the picture hold what was passed, are complete files, and need no network.
#include "report/page.hpp"

#include "report/detail/display.hpp"
#include "report/detail/encoding.hpp"
#include "report/detail/picture.hpp"
#include "report/detail/viewer_surface.hpp"
#include "report/detail/viewer_volumes.hpp"

#include "core/errors.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <opencv2/imgcodecs.hpp>

#include <cstdlib>
#include <fstream>
#include <limits>

namespace tissuewarp::report {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using imaging::Geometry;
using imaging::Volume;
using nlohmann::json;

Geometry grid_of(const std::array<int, 3>& size, const Vector3d& spacing, double degrees) {
    Geometry grid;
    grid.size = size;
    grid.spacing = spacing;
    grid.direction = Eigen::AngleAxisd(degrees * EIGEN_PI / 180, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
    grid.origin -= grid.point(Vector3d(size[0] - 1, size[1] - 1, size[2] - 1) / 2);
    return grid;
}

template <class T, class Value>
Volume filled(const Geometry& grid, int type, const Value& value) {
    Volume volume(grid, type);
    std::int64_t offset = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) volume.data<T>()[offset++] = value(grid.point(Vector3d(i, j, k)));
    return volume;
}

/// A ball of 40 mm that is brightest in front; it moved by 5 mm at most, towards the head, around a place on its right.
struct Example {
    Geometry grid = grid_of({48, 40, 30}, {2.2, 2.5, 3.6}, 20);
    Vector3d place{-22, 6, 9};
    Volume moving = filled<float>(grid, CV_32FC1,
                                  [](const Vector3d& p) { return static_cast<float>(p.norm() < 40 ? 200 - p[1] : 0); });
    Volume labels =
        filled<int>(grid, CV_32SC1, [](const Vector3d& p) { return p.norm() < 40 ? (p[0] < 0 ? 1 : 2) : 0; });
    Volume field = filled<cv::Vec3f>(grid, CV_32FC3, [this](const Vector3d& p) {
        return cv::Vec3f(0, 0, static_cast<float>(5 * std::exp(-(p - place).squaredNorm() / 300)));
    });

    [[nodiscard]] ReportInput input(const json& report = {}) const {
        return {&moving, &moving, &moving, &labels, &labels, &labels, &field,
                nullptr, nullptr, nullptr, nullptr, nullptr, report};
    }
};

json example_report() {
    std::ifstream file(tissuewarp::test::source_folder() / "tests/report/report.json");
    return json::parse(file);
}

class Pages : public testing::Test {
protected:
    fs::path folder = fs::path(testing::TempDir()) /
                      (std::string("pages-") + testing::UnitTest::GetInstance()->current_test_info()->name());
    Example example;
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }

    [[nodiscard]] std::string page() const {
        std::ifstream stream(folder / "report.html", std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }
    /// Exit code of Debian's Python on a script of this folder.
    [[nodiscard]] int python(const std::string& arguments) const {
        const std::string script = (tissuewarp::test::source_folder() / "tests/report/check_page.py ").string();
        const int status = std::system(("/usr/bin/python3 " + script + arguments).c_str());
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
};

TEST(Planes, LieAsRadiologistsLookAtThem) {
    const auto planes = detail::planes_through({1, 2, 3}, {{-10, -20, -30}, {10, 20, 30}}, 0.5);
    // Axial: 40 × 80 pixels, columns towards the patient's left, rows towards the back.
    EXPECT_EQ(planes[0].grid.size, (std::array<int, 3>{40, 80, 1}));
    const auto across = [&](int plane) {
        const Geometry& grid = planes[static_cast<std::size_t>(plane)].grid;
        return Vector3d(grid.point({1, 0, 0}) - grid.point({0, 0, 0}));
    };
    const auto down = [&](int plane) {
        const Geometry& grid = planes[static_cast<std::size_t>(plane)].grid;
        return Vector3d(grid.point({0, 1, 0}) - grid.point({0, 0, 0}));
    };
    const Vector3d left(0.5, 0, 0), back(0, 0.5, 0), feet(0, 0, -0.5);
    EXPECT_LT((across(0) - left).norm() + (down(0) - back).norm(), 1e-12);
    EXPECT_LT((across(1) - left).norm() + (down(1) - feet).norm(), 1e-12);
    EXPECT_LT((across(2) - back).norm() + (down(2) - feet).norm(), 1e-12);
    EXPECT_DOUBLE_EQ(planes[0].grid.point({0, 0, 0})[2], 3.0);
    EXPECT_DOUBLE_EQ(planes[1].grid.point({0, 0, 0})[1], 2.0);
    EXPECT_DOUBLE_EQ(planes[2].grid.point({0, 0, 0})[0], 1.0);
    // The box's edge is the edge of the outermost pixel.
    EXPECT_NEAR(planes[0].grid.point({-0.5, -0.5, 0})[0], -10.0, 1e-9);
    EXPECT_NEAR(planes[0].grid.point({-0.5, 79.5, 0})[1], 20.0, 1e-9);
}

TEST(Planes, ShowObliqueVolumesWhereTheyLie) {
    // Grey value = x + 2 y + 3 z on an oblique grid: the slice must show it in LPS, to interpolation's rounding.
    const Geometry grid = grid_of({40, 44, 36}, {1.5, 1.4, 2.0}, 30);
    const Volume ramp =
        filled<float>(grid, CV_32FC1, [](const Vector3d& p) { return static_cast<float>(p.dot(Vector3d(1, 2, 3))); });
    for (const detail::Plane& plane : detail::planes_through({2, -3, 4}, {{-8, -8, -8}, {8, 8, 8}}, 0.8)) {
        const cv::Mat values = detail::slice(ramp, plane, imaging::Interpolation::Linear);
        ASSERT_EQ(values.rows, plane.grid.size[1]);
        for (int row = 0; row < values.rows; row += 3)
            for (int column = 0; column < values.cols; column += 3) {
                const Vector3d point = plane.grid.point(Vector3d(column, row, 0));
                EXPECT_NEAR(values.at<float>(row, column), point.dot(Vector3d(1, 2, 3)), 1e-3) << plane.name;
            }
    }
}

TEST(Planes, CoverTheLabelsTightlyOnObliqueGrids) {
    const Example example;
    const auto box = detail::label_box(example.labels);
    ASSERT_TRUE(box);
    // A ball of 40 mm; voxels of up to 3.6 mm, whose centres are counted.
    EXPECT_LT((box->upper - Vector3d::Constant(40)).cwiseAbs().maxCoeff(), 1.5);
    EXPECT_LT((box->lower + Vector3d::Constant(40)).cwiseAbs().maxCoeff(), 1.5);
    EXPECT_FALSE(detail::label_box(Volume(example.grid, CV_32SC1)));
}

TEST(Focus, IsWhereTissueMovedMostBeyondTheAlignment) {
    const Example example;
    // A rigid motion on top of the bump must not draw the focus away.
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = Eigen::AngleAxisd(0.3, Vector3d::UnitX()).toRotationMatrix();
    motion.translation() = Vector3d(30, -20, 10);
    const Volume field = filled<cv::Vec3f>(example.grid, CV_32FC3, [&](const Vector3d& p) {
        const double bump = 5 * std::exp(-(p - example.place).squaredNorm() / 300);
        const Vector3d u = motion * Vector3d(p + Vector3d(0, 0, bump)) - p;
        return cv::Vec3f(static_cast<float>(u[0]), static_cast<float>(u[1]), static_cast<float>(u[2]));
    });
    const Volume magnitude = detail::elastic_magnitude(field, motion);
    const detail::Focus focus = detail::largest_displacement(field, magnitude, example.labels);
    EXPECT_NEAR(focus.displacement, 5.0, 0.1);
    EXPECT_LT((focus.moving - example.place).norm(), 3.0);
    EXPECT_LT((focus.fixed - motion * Vector3d(example.place + Vector3d(0, 0, 5))).norm(), 3.5);
}

TEST(Alignment, IsReadFromEitherFormAndIgnoredWhenOdd) {
    const json rows = {{"alignment", {{"matrix", {{1, 0, 0, 7}, {0, 1, 0, 8}, {0, 0, 1, 9}, {0, 0, 0, 1}}}}}};
    const json flat = {{"alignment", {{"matrix", {1, 0, 0, 7, 0, 1, 0, 8, 0, 0, 1, 9, 0, 0, 0, 1}}}}};
    EXPECT_EQ(detail::alignment_of(rows).translation(), Vector3d(7, 8, 9));
    EXPECT_EQ(detail::alignment_of(flat).translation(), Vector3d(7, 8, 9));
    for (const json& odd : {json(), json{{"alignment", nullptr}}, json{{"alignment", {{"matrix", {1, "x"}}}}}})
        EXPECT_EQ(detail::alignment_of(odd).matrix(), Eigen::Matrix4d::Identity());
}

TEST_F(Pages, AreWellFormedCompleteAndNeedNoNetwork) {
    write_report(example.input(example_report()), folder);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 2);
    EXPECT_LT(fs::file_size(folder / "report.html"), 3u << 20);
    // What report.json says, as the page shows it.
    EXPECT_EQ(
        python(
            (folder / "report.html").string() +
            " 4.41 1.06 0.962 0.993 0.624 0.031 'Neo &lt;Hooke&gt; &amp; co' 9f86d081884c7d659a2feaa0c55ad015 '1830 MB'"
            " '<td>tetrahedra of the organ</td><td>0.624</td>' '<td>voxels of the whole field</td><td>0.555</td>'"
            " '2.41 →' '0.962 →' '1234 nodes' '48 × 40 × 30' 'a &lt;b&gt;.nii.gz' 'sform and qform disagree'"
            " 'only 78 % of the nodes were matched'"),
        0);
}

TEST_F(Pages, LeaveOutWhatIsMissing) {
    write_report(example.input(), folder);
    const std::string text = page();
    for (const char* heading : {"<h2>Rounds", "<h2>Overlap", "<h2>Inputs", "<h2>Time", "<h2>Parameters", "<h2>Target"})
        EXPECT_THAT(text, testing::Not(testing::HasSubstr(heading)));
    EXPECT_THAT(text, testing::HasSubstr("<h2>Which field for what"));
    EXPECT_EQ(python((folder / "report.html").string()), 0);
}

TEST_F(Pages, ShowNoTileForWhatOnlyATableHolds) {
    write_report(example.input({{"jacobian", {{"field", {{"minimum", 0.7}, {"folded", 3}}}}}}), folder);
    EXPECT_THAT(page(), testing::Not(testing::HasSubstr("Smallest local volume ratio")));
    EXPECT_THAT(page(), testing::HasSubstr("<td>voxels of the whole field</td><td>0.700</td>"));
}

// The error estimate holds what the solver left.
TEST_F(Pages, ShowWhatTheSolverLeftWhereNothingElseIsEstimated) {
    write_report(example.input({{"estimated_error_mm", 0.03}}), folder);
    EXPECT_THAT(page(), testing::HasSubstr("Estimated error of the solver"));
    write_report(example.input({{"estimated_error_mm", 0.03}, {"error_estimate", {{"deviation_mm", 0.9}}}}), folder);
    EXPECT_THAT(page(), testing::HasSubstr("Estimated error of targets"));
    EXPECT_THAT(page(), testing::Not(testing::HasSubstr("Estimated error of the solver")));
}

TEST_F(Pages, SurviveReportsOfOddTypes) {
    const json odd = {{"inputs", 3},
                      {"stages", {1, "x", nullptr}},
                      {"rounds", {{"a", 1}}},
                      {"overlap", {{"before", {{"1", nullptr}}}, {"after", "none"}}},
                      {"target_registration_error", {{"all", {{"after", 3}}}}},
                      {"jacobian", {{"mesh", {{"minimum", nullptr}}}}},
                      {"alignment", {{"matrix", {{1}, {}}}}},
                      {"doubts", {1, 2}},
                      {"parameters", "a = 1\n<b>"}};
    write_report(example.input(odd), folder);
    EXPECT_EQ(python((folder / "report.html").string() + " '&lt;b&gt;'"), 0);
    write_report(example.input(json::array({1})), folder);
}

TEST_F(Pages, AreMadeOfLabelsAlone) {
    ReportInput input;
    input.moving_labels = input.fixed_labels = &example.labels;
    write_report(input, folder);
    input.fixed_labels = nullptr;
    input.warped_labels = &example.labels;  // of a registration to points
    write_report(input, folder);
    EXPECT_FALSE(cv::imread((folder / "preview.png").string()).empty());
    EXPECT_EQ(python((folder / "report.html").string()), 0);
}

TEST_F(Pages, RefuseWhatCannotBeShown) {
    ReportInput input = example.input();
    input.fixed_labels = input.warped_labels = nullptr;
    EXPECT_THROW(write_report(input, folder), InvalidInput);
    const Volume empty(example.grid, CV_32SC1);
    input.fixed_labels = &empty;
    EXPECT_THROW(write_report(input, folder), InvalidInput);
    input = example.input();
    input.moving_to_fixed = &example.moving;
    EXPECT_THROW(write_report(input, folder), InvalidInput);
    EXPECT_THROW(write_report(example.input(), folder / "missing"), IoError);
    EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(Pages, ShowTheSameTwice) {
    write_report(example.input(example_report()), folder);
    const std::string first = page();
    write_report(example.input(example_report()), folder);
    EXPECT_EQ(first, page());
}

TEST_F(Pages, HaveFiveColumnsInTheirPicture) {
    const cv::Mat whole = detail::draw_preview(example.input()).picture;
    ReportInput input = example.input();
    input.moving_to_fixed = nullptr;
    input.warped = nullptr;
    const cv::Mat fewer = detail::draw_preview(input).picture;
    EXPECT_EQ(whole.type(), CV_8UC3);
    EXPECT_GT(whole.cols, fewer.cols + 700);
}

/// The axial panels are the first row; pixels from their middle, which is that of the ball.
struct AxialPanels {
    cv::Mat picture;
    [[nodiscard]] cv::Vec3b at(int column, int right, int down) const {
        constexpr int first = 16, step = 370, half = 180, top = 84;  // the layout of picture.cpp
        return picture.at<cv::Vec3b>(top + half + down, first + column * step + half + right);
    }
};

TEST_F(Pages, ShowTheFrontOnTopAndTheRightOnTheLeft) {
    const AxialPanels panels{detail::draw_preview(example.input()).picture};
    // The ball is brighter in front; outlines run along the rim and down the middle.
    EXPECT_GT(panels.at(0, 40, -70)[1], panels.at(0, 40, 70)[1] + 20);
    // What moved lies on the patient's right, in front of nothing: viridis is brighter there.
    EXPECT_GT(panels.at(4, -80, 30)[1], panels.at(4, 80, 30)[1] + 30);
}

TEST_F(Pages, ShowInRedWhatIsBrighterDuringTheOperation) {
    const AxialPanels same{detail::draw_preview(example.input()).picture};
    for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(same.at(2, 40, 20)[channel], 247, 3);
    // A part in the back, whose values stay below those of the front: the grey window does not change.
    const auto changed = [&](float by) {
        return filled<float>(example.grid, CV_32FC1, [by](const Vector3d& p) {
            const float value = static_cast<float>(p.norm() < 40 ? 200 - p[1] : 0);
            return (p - Vector3d(12, 20, 14)).norm() < 14 ? value + by : value;
        });
    };
    const Volume brighter = changed(40), darker = changed(-40);
    ReportInput input = example.input();
    input.fixed = &brighter;
    const cv::Vec3b red = AxialPanels{detail::draw_preview(input).picture}.at(2, 38, 62);
    EXPECT_GT(red[2], red[0] + 20);
    input.fixed = &darker;
    const cv::Vec3b blue = AxialPanels{detail::draw_preview(input).picture}.at(2, 38, 62);
    EXPECT_GT(blue[0], blue[2] + 20);
}

// Two millimetres on the patient's left, none on the right; the back of the left is not to be trusted.
TEST_F(Pages, ShowWhereTheErrorIsLargeAndWhereNothingIsKnown) {
    const Volume error = filled<float>(example.grid, CV_32FC1, [](const Vector3d& p) {
        return p.norm() >= 40 ? std::numeric_limits<float>::quiet_NaN() : p[0] > 0 ? 2.0F : 0.1F;
    });
    const Volume trust = filled<std::uint8_t>(example.grid, CV_8UC1, [](const Vector3d& p) {
        return std::uint8_t(p.norm() >= 40 ? 0 : p[0] > 0 && p[1] > 0 ? 3 : p[1] > 0 ? 2 : 1);
    });
    ReportInput input = example.input();
    input.uncertainty = &error;
    EXPECT_THROW(detail::draw_preview(input), InvalidInput);
    input.trust = &trust;
    const AxialPanels panels{detail::draw_preview(input).picture};
    EXPECT_GT(panels.at(4, 80, -30)[1], panels.at(4, -80, -30)[1] + 60);  // viridis
    const auto darkest = [&](int down) {
        int least = 255;
        for (int right = 60; right < 80; ++right) least = std::min<int>(least, panels.at(4, right, down)[1]);
        return least;
    };
    EXPECT_LT(darkest(40), 60);
    EXPECT_GT(darkest(-40), 100);
}

// Grey values of pure noise are the worst that a picture has to hold.
TEST_F(Pages, StayBelowSixMegabytesOfNoise) {
    unsigned state = 1;
    const Geometry grid = grid_of({160, 160, 160}, {0.7, 0.7, 0.7}, 0);
    const Volume noise = filled<float>(grid, CV_32FC1, [&](const Vector3d&) {
        return static_cast<float>((state = state * 1664525u + 1013904223u) >> 16);
    });
    ReportInput input = example.input(example_report());
    input.moving = input.fixed = input.warped = &noise;
    write_report(input, folder);
    EXPECT_LT(fs::file_size(folder / "report.html"), 6'000'000u);
}

/// A cube of 40 mm in tetrahedra of two labels, six to a cell of `edge` mm; the upper half is label 2.
meshing::TetMesh cube_mesh(int cells) {
    meshing::TetMesh mesh;
    const int n = cells + 1;
    mesh.nodes.resize(3, n * n * n);
    for (int k = 0; k < n; ++k)
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i)
                mesh.nodes.col((k * n + j) * n + i) = Vector3d(i, j, k) * 40.0 / cells - Vector3d::Constant(20);
    std::vector<std::array<int, 5>> tets;
    constexpr int paths[6][2] = {{0, 1}, {1, 0}, {1, 2}, {2, 1}, {2, 0}, {0, 2}};
    const std::array<int, 3> step{1, n, n * n};
    for (int k = 0; k < cells; ++k)
        for (int j = 0; j < cells; ++j)
            for (int i = 0; i < cells; ++i)
                for (const auto& path : paths) {
                    const int a = (k * n + j) * n + i, b = a + step[static_cast<std::size_t>(path[0])],
                              c = b + step[static_cast<std::size_t>(path[1])], d = a + step[0] + step[1] + step[2];
                    tets.push_back({a, b, c, d, 2 * k < cells ? 1 : 2});
                }
    mesh.tets.resize(4, static_cast<Eigen::Index>(tets.size()));
    mesh.labels.resize(mesh.tets.cols());
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const auto& tet = tets[static_cast<std::size_t>(t)];
        mesh.tets.col(t) << tet[0], tet[1], tet[2], tet[3];
        mesh.labels[t] = tet[4];
        const Vector3d origin = mesh.nodes.col(tet[0]);
        if ((mesh.nodes.col(tet[1]) - origin)
                .cross(mesh.nodes.col(tet[2]) - origin)
                .dot(mesh.nodes.col(tet[3]) - origin) < 0)
            std::swap(mesh.tets(1, t), mesh.tets(2, t));
    }
    return mesh;
}

TEST(Decimation, KeepsTheShapeWithFewerNodes) {
    const meshing::SurfaceMesh cube = meshing::boundary_surface(cube_mesh(20)).surface;
    std::vector<std::array<int, 3>> faces;
    for (const auto& t : cube.triangles.colwise()) faces.push_back({t[0], t[1], t[2]});
    const int outer = static_cast<int>(faces.size());
    const detail::Decimated all = detail::decimated(cube.nodes, faces, outer, 100'000);
    EXPECT_EQ(all.kept.size(), static_cast<std::size_t>(cube.node_count()));
    EXPECT_EQ(all.triangles.size(), faces.size());
    const detail::Decimated few = detail::decimated(cube.nodes, faces, outer, 500);
    EXPECT_LE(few.kept.size(), 500u);
    EXPECT_GT(few.kept.size(), 200u);
    EXPECT_EQ(few.outer, static_cast<int>(few.triangles.size()));
    double volume = 0;
    for (const auto& t : few.triangles) {
        const auto at = [&](std::size_t c) -> Vector3d {
            return cube.nodes.col(few.kept[static_cast<std::size_t>(t[c])]);
        };
        volume += at(0).dot(at(1).cross(at(2))) / 6;
    }
    EXPECT_NEAR(volume, 64000, 5000) << "closed, and facing outwards as before";
}

TEST_F(Pages, HoldTheSurfaceWithItsDisplacements) {
    const meshing::TetMesh mesh = cube_mesh(4);
    const Eigen::Matrix3Xd moved = mesh.nodes.colwise() + Vector3d(0, 3, 0);
    ReportInput input = example.input();
    EXPECT_TRUE(detail::viewer_surface(input, 6, 1).is_null());
    input.mesh = &mesh;
    input.fixed_nodes = &moved;
    const json surface = detail::viewer_surface(input, 6, 1);
    EXPECT_EQ(surface["outer"], 6 * 32);
    EXPECT_EQ(surface["triangles"], 6 * 32 + 32) << "and the face between the labels";
    EXPECT_EQ(surface["nodes"], 125 - 27 + 9);
    EXPECT_EQ(surface["lower"], json({-20.0, -20.0, -20.0}));
    EXPECT_EQ(surface["extent"], json({40.0, 43.0, 40.0}));
    const std::string data = surface["data"];
    EXPECT_EQ(data.size(), data.find(',') + 1 + (107 * 15 + 224 * 6 + 2) / 3 * 4);
    const std::vector<unsigned char> half(107, 128);
    EXPECT_THAT(data, testing::HasSubstr(detail::base64({half.begin(), half.begin() + 60}).substr(0, 76)));
}

TEST_F(Pages, HoldVolumesOfOneGrid) {
    const auto box = detail::label_box(example.labels);
    const json volumes = detail::viewer_volumes(example.input(), *box, 5, 1);
    const json& size = volumes["grid"]["size"];
    EXPECT_LE(size[0].get<double>() * size[1].get<double>() * size[2].get<double>(), detail::most_viewer_voxels);
    for (const char* name : {"fixed", "before", "after", "labels"}) EXPECT_TRUE(volumes.contains(name)) << name;
    EXPECT_FALSE(volumes.contains("values"));
    ReportInput input = example.input();
    input.fixed_to_moving = &example.field;
    input.moving = nullptr;
    const json others = detail::viewer_volumes(input, *box, 5, 1);
    EXPECT_FALSE(others.contains("before"));
    EXPECT_EQ(others["values"]["displacement_mm"], 5);
    EXPECT_FALSE(others["values"].contains("error_mm"));
}

}  // namespace
}  // namespace tissuewarp::report
