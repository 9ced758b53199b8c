/// The page and the picture hold what was passed, are complete files, and need no network.
#include "report/page.hpp"

#include "report/detail/display.hpp"
#include "report/detail/picture.hpp"

#include "core/errors.hpp"

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
        return {&moving, &moving, &moving, &labels, &labels, &labels, &field, nullptr, nullptr, report};
    }
};

json example_report() {
    std::ifstream file(std::string(TISSUEWARP_SOURCE_DIR) + "/tests/report/report.json");
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
        const std::string script = std::string(TISSUEWARP_SOURCE_DIR) + "/tests/report/check_page.py ";
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

TEST_F(Pages, AreDrawnByABrowser) {
    if (!fs::exists("/usr/bin/chromium")) GTEST_SKIP() << "no chromium";
    write_report(example.input(example_report()), folder);
    const fs::path shot = folder / "shot.png", profile = folder / "profile";
    const std::string command =
        "timeout 60 /usr/bin/chromium --headless --no-sandbox --disable-gpu --disable-background-networking "
        "--no-first-run --user-data-dir=" +
        profile.string() + " --window-size=1200,1600 --screenshot=" + shot.string() + " file://" +
        (folder / "report.html").string() + " >/dev/null 2>&1";
    if (std::system(command.c_str()) != 0 || !fs::exists(shot)) GTEST_SKIP() << "chromium does not run here";
    const cv::Mat picture = cv::imread(shot.string());
    ASSERT_EQ(picture.cols, 1200);
    cv::Scalar mean, deviation;
    cv::meanStdDev(picture, mean, deviation);
    EXPECT_GT(deviation[0], 20.0) << "the page is blank";
}

}  // namespace
}  // namespace tissuewarp::report
