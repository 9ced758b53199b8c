#include "registration/evaluation.hpp"

#include "registration/evaluation/percentile.hpp"
#include "registration/field.hpp"
#include "registration/io/slicer_markups.hpp"

#include "core/errors.hpp"
#include "shapes.hpp"
#include "tests/support/noted.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <vector>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;
using test::for_each_voxel;
using ::testing::HasSubstr;

TEST(Summary, TakesPercentilesLinearlyBetweenOrderStatistics) {
    const Summary summary = summarise({4.0, 1.0, 3.0, 2.0});
    EXPECT_EQ(summary.count, 4);
    EXPECT_DOUBLE_EQ(summary.mean, 2.5);
    EXPECT_DOUBLE_EQ(summary.median, 2.5);
    EXPECT_DOUBLE_EQ(summary.percentile_95, 3.85);  // numpy.percentile([1, 2, 3, 4], 95)
    EXPECT_DOUBLE_EQ(summary.maximum, 4.0);
}

TEST(Summary, OfOneValueAndOfNone) {
    const Summary one = summarise({7.0});
    EXPECT_EQ(one.median, 7.0);
    EXPECT_EQ(one.percentile_95, 7.0);
    EXPECT_EQ(summarise({}).count, 0);
    EXPECT_THROW(summarise({1.0, std::nan("")}), InvalidInput);
}

TEST(Percentiles, AreThoseOfTheSortedValues) {
    std::vector<float> values;
    for (int n = 0; n < 1237; ++n) values.push_back(static_cast<float>(n * 733 % 1237) / 7.0F);
    std::vector<float> ascending = values;
    std::sort(ascending.begin(), ascending.end());
    constexpr std::array wanted{0.0, 1.0, 5.0, 50.0, 95.0, 99.0, 100.0};
    const std::array found = detail::percentiles(values, wanted);
    for (std::size_t n = 0; n < wanted.size(); ++n) {
        const double place = wanted[n] / 100 * 1236;
        const auto below = static_cast<std::size_t>(place), above = std::min<std::size_t>(below + 1, 1236);
        const double expected = ascending[below] + (place - double(below)) * (ascending[above] - ascending[below]);
        EXPECT_NEAR(found[n], expected, 1e-4) << wanted[n];
    }
}

TEST(TargetError, SeparatesLandmarksThatMoved) {
    Landmarks landmarks{Eigen::Matrix3Xd::Zero(3, 3), Eigen::Matrix3Xd::Zero(3, 3)};
    landmarks.fixed.row(0) << 0.0, 3.0, 5.0;
    Eigen::Matrix3Xd mapped = Eigen::Matrix3Xd::Zero(3, 3);
    mapped.row(0) << 0.0, 3.0, 4.0;
    mapped.row(1) << 1.0, 0.0, 0.0;
    const TargetError error = target_error(landmarks, mapped, 2.0);
    EXPECT_DOUBLE_EQ(error.before.mean, 8.0 / 3.0);
    EXPECT_DOUBLE_EQ(error.after.mean, 2.0 / 3.0);
    EXPECT_EQ(error.moved_after.count, 2);
    EXPECT_DOUBLE_EQ(error.moved_before.mean, 4.0);
    EXPECT_DOUBLE_EQ(error.moved_after.mean, 0.5);
    EXPECT_THROW(target_error(landmarks, Eigen::Matrix3Xd::Zero(3, 2)), InvalidInput);
}

/// Voxels whose index satisfies `inside` get the label.
template <class Inside>
void paint(Volume& labels, int label, const Inside& inside) {
    for_each_voxel(labels, [&](const Eigen::Vector3d& index, std::int64_t n) {
        if (inside(index)) labels.data<std::int32_t>()[n] = label;
    });
}

auto box(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper) {
    return [=](const Eigen::Vector3d& i) {
        return (i.array() >= lower.array()).all() && (i.array() < upper.array()).all();
    };
}

TEST(Overlap, OfAMapWithItselfIsPerfect) {
    Volume labels(test::oblique_grid({0, 0, 0}, {20, 20, 20}, {1, 2, 3}), CV_32SC1);
    paint(labels, 2, box({3, 3, 3}, {12, 12, 12}));
    paint(labels, 5, box({12, 3, 3}, {17, 12, 12}));
    const auto result = overlap(labels, labels);
    ASSERT_EQ(result.size(), 3U);
    for (const int label : {0, 2, 5}) {
        EXPECT_DOUBLE_EQ(result.at(label).dice, 1.0);
        EXPECT_EQ(result.at(label).mean_surface_distance_mm, 0.0);
        EXPECT_EQ(result.at(label).hausdorff_95_mm, 0.0);
    }
}

TEST(Overlap, OfShiftedBoxesHasTheValuesCountedByHand) {
    // Two cubes of 10 voxels, 2 apart along an axis with spacing 1.5 mm: Dice 8/10. Of the 600 faces of a cube the 100
    // at either end lie 3 mm from the other cube, and 2 columns × 40 side faces stick out: their centres are 0.5 or 1.5
    // voxels beyond the other cube's end face in x, and √(0.5² + …) away from its nearest face centre.
    Geometry grid = test::plain_grid({24, 16, 16});
    grid.spacing = {1.5, 1.0, 1.0};
    Volume a(grid, CV_32SC1), b(grid, CV_32SC1);
    paint(a, 1, box({4, 3, 3}, {14, 13, 13}));
    paint(b, 1, box({6, 3, 3}, {16, 13, 13}));
    const Overlap result = overlap(a, b).at(1);
    EXPECT_DOUBLE_EQ(result.dice, 0.8);
    // End face of a, x = 3.5 (voxels): b's end face is 3 mm away, but faces near the rim of a's end may lie closer to
    // b's side faces, whose first centres are at x = 6: hypot(2.5·1.5, 0.5) > 3, so 3 mm it is for all 100. The other
    // end of a, x = 13.5, lies inside b: nearest are b's side faces at depth d and b's end at 3 mm.
    double sum = 100 * 3.0, largest = 3.0;
    for (int y = 0; y < 10; ++y)
        for (int z = 0; z < 10; ++z) {  // depth from the side to the face centre, and half a voxel along x to centres
            const double depth = 0.5 + std::min({y, z, 9 - y, 9 - z});
            sum += std::min(3.0, std::hypot(depth, 0.75));
        }
    for (const double x : {1.5, 0.5})  // protruding side columns: to b's side centre at x + 0.5 … or its end face rim
        sum += 40 * std::min(std::hypot(x * 1.5, 0.5), (x + 0.5) * 1.5);
    EXPECT_NEAR(result.mean_surface_distance_mm, sum / 600.0, 1e-9);
    EXPECT_DOUBLE_EQ(result.hausdorff_95_mm, largest);
}

TEST(Overlap, OfConcentricBallsIsTheDifferenceOfTheirRadii) {
    const Geometry grid = test::plain_grid({64, 64, 64}, 0.5);
    Volume a(grid, CV_16UC1), b(grid, CV_8UC1);
    for_each_voxel(a, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const double r = (grid.point(index) - Eigen::Vector3d::Constant(15.75)).norm();
        a.data<std::uint16_t>()[n] = r < 10.0 ? 3 : 0;
        b.data<std::uint8_t>()[n] = r < 13.0 ? 3 : 0;
    });
    const Overlap result = overlap(a, b).at(3);
    EXPECT_NEAR(result.dice, 2.0 * 1000.0 / (1000.0 + 2197.0), 0.003);
    EXPECT_NEAR(result.mean_surface_distance_mm, 3.0, 0.15);
    EXPECT_NEAR(result.hausdorff_95_mm, 3.0, 0.35);  // voxel steps of 0.5 mm
}

/// Centres of faces between a label (0: all) and what is not of it, mm along the axes.
std::vector<Eigen::Vector3d> faces_of(const imaging::Volume& labels, int label) {
    std::vector<Eigen::Vector3d> centres;
    const auto& size = labels.geometry.size;
    const auto is_of = [&](int i, int j, int k) {
        const int value = labels.data<int>()[labels.offset(i, j, k)];
        return label == 0 ? value != 0 : value == label;
    };
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i)
                for (int axis = 0; axis < 3; ++axis) {
                    std::array<int, 3> next{i, j, k};
                    if (++next[axis] == size[axis] || is_of(i, j, k) == is_of(next[0], next[1], next[2])) continue;
                    const Eigen::Vector3d centre = Eigen::Vector3d(i, j, k) + 0.5 * Eigen::Vector3d::Unit(axis);
                    centres.push_back(centre.cwiseProduct(labels.geometry.spacing));
                }
    return centres;
}

double mean_distance(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
    double sum = 0;
    for (const Eigen::Vector3d& a : from) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Eigen::Vector3d& b : to) nearest = std::min(nearest, (a - b).norm());
        sum += nearest;
    }
    return sum / double(from.size());
}

// Most faces of maps that nearly agree are the same, and the others are near.
TEST(Overlap, OfScatteredLabelsIsThatOfEveryPairOfFaces) {
    imaging::Geometry grid;
    grid.size = {12, 9, 8};
    grid.spacing = {1, 0.7, 1.6};
    imaging::Volume a(grid, CV_32S), b(grid, CV_32S);
    std::mt19937 random(3);
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) {
        a.data<int>()[n] = static_cast<int>(random() % 3);
        b.data<int>()[n] = random() % 8 == 0 ? static_cast<int>(random() % 3) : a.data<int>()[n];
    }
    const auto measured = overlap(a, b);
    for (const int label : {0, 1, 2}) {
        const auto in_a = faces_of(a, label), in_b = faces_of(b, label);
        EXPECT_NEAR(measured.at(label).mean_surface_distance_mm,
                    0.5 * (mean_distance(in_a, in_b) + mean_distance(in_b, in_a)), 1e-12);
        long long here = 0, there = 0, both = 0;
        for (std::int64_t n = 0; n < grid.voxel_count(); ++n) {
            const auto is = [&](int value) { return label == 0 ? value != 0 : value == label; };
            here += is(a.data<int>()[n]);
            there += is(b.data<int>()[n]);
            both += is(a.data<int>()[n]) && is(b.data<int>()[n]);
        }
        EXPECT_DOUBLE_EQ(measured.at(label).dice, 2.0 * double(both) / double(here + there));
    }
}

TEST(Overlap, OfALabelMissingInOneMapIsZeroAndInfinitelyFar) {
    Volume a(test::plain_grid({12, 12, 12}), CV_32SC1), b = a.clone();
    paint(a, 1, box({2, 2, 2}, {8, 8, 8}));
    paint(a, 4, box({3, 3, 3}, {5, 5, 5}));
    paint(b, 1, box({2, 2, 2}, {8, 8, 8}));
    for (const auto& result : {overlap(a, b), overlap(b, a)}) {
        EXPECT_EQ(result.at(4).dice, 0.0);
        EXPECT_TRUE(std::isinf(result.at(4).hausdorff_95_mm));
        EXPECT_DOUBLE_EQ(result.at(0).dice, 1.0);  // the union does not see the inner label
        EXPECT_EQ(result.at(0).hausdorff_95_mm, 0.0);
    }
}

TEST(Overlap, OfDifferentGridsIsRefused) {
    Volume a(test::plain_grid({12, 12, 12}), CV_32SC1), b(test::plain_grid({12, 12, 12}, 1.01), CV_32SC1);
    EXPECT_THROW(overlap(a, b), InvalidInput);
    EXPECT_THROW(overlap(a, Volume(a.geometry, CV_32FC1)), InvalidInput);
}

TEST(MeshJacobians, OfAStretchIsItsFactorAndWeighsByVolume) {
    meshing::TetMesh mesh = meshing::box_mesh({10, 10, 20}, {1, 1, 2});
    // The lower cell keeps its height, the upper one doubles.
    const Deformation deformation =
        test::deformed_by(mesh, [](const auto& X) { return Eigen::Vector3d(0, 0, std::max(X[2] - 10.0, 0.0)); });
    const JacobianReport report = mesh_jacobians(deformation);
    EXPECT_NEAR(report.minimum, 1.0, 1e-12);
    EXPECT_NEAR(report.maximum, 2.0, 1e-12);
    EXPECT_NEAR(report.median, 1.5, 1e-12);  // halfway between the two halves of equal volume
    EXPECT_EQ(report.folded, 0);

    meshing::TetMesh uneven = meshing::box_mesh({10, 10, 20}, {1, 1, 2});
    for (auto node : uneven.nodes.colwise())
        if (node[2] == 10.0) node[2] = 18.0;
    const JacobianReport weighted = mesh_jacobians(
        test::deformed_by(uneven, [](const auto& X) { return Eigen::Vector3d(0, 0, std::max(X[2] - 18.0, 0.0)); }));
    EXPECT_NEAR(weighted.median, 1.0, 1e-12);  // nine tenths of the volume
    EXPECT_NEAR(weighted.percentile_99, 2.0, 1e-12);
}

TEST(MeshJacobians, FindsAMirroredElement) {
    const meshing::TetMesh mesh = test::box_at({100, 0, 0}, {10, 10, 10}, {1, 1, 1});
    const Deformation deformation =
        test::deformed_by(mesh, [](const auto& X) { return Eigen::Vector3d(-2.0 * (X[0] - 100.0), 0, 0); });
    const JacobianReport report = mesh_jacobians(deformation);
    EXPECT_NEAR(report.maximum, -1.0, 1e-12);
    EXPECT_EQ(report.folded, 6);
    EXPECT_NEAR(report.folded_mm3, 1000.0, 1e-9);
    ASSERT_EQ(report.folded_places.size(), 6U);
    for (const auto& place : report.folded_places) EXPECT_NEAR(place[0], 105.0, 5.0);  // rest positions
}

TEST(FieldJacobians, FindsAFoldItsVolumeAndItsPlace) {
    const Geometry grid = test::oblique_grid({0, 0, 0}, {21, 5, 5}, {2.0, 1.0, 1.5});
    Volume field(grid, CV_32FC3);
    // Along axis i the points of voxels 10 and 11 change order: d jumps by −3 voxels between them.
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d d =
            index[0] > 10 ? Eigen::Vector3d(-6.0 * grid.direction.col(0)) : Eigen::Vector3d::Zero();
        for (int c = 0; c < 3; ++c) field.data<cv::Vec3f>()[n][c] = static_cast<float>(d[c]);
    });
    const JacobianReport report = field_jacobians(field);
    EXPECT_NEAR(report.minimum, 1.0 - 1.5, 1e-5);  // central difference: −6 mm over 4 mm
    EXPECT_EQ(report.folded, 2 * 25);
    EXPECT_NEAR(report.folded_mm3, 50 * 3.0, 1e-9);
    ASSERT_EQ(report.folded_places.size(), 20U);
    for (const auto& place : report.folded_places) EXPECT_NEAR(grid.index(place)[0], 10.5, 0.5 + 1e-9);
    EXPECT_NEAR(report.median, 1.0, 1e-5);

    Volume mask(grid, CV_8UC1);
    for_each_voxel(mask,
                   [&](const Eigen::Vector3d& index, std::int64_t n) { mask.data<std::uint8_t>()[n] = index[0] < 5; });
    EXPECT_EQ(field_jacobians(field, &mask).folded, 0);
    EXPECT_EQ(jacobian_report(jacobian_determinant(field), &mask).folded, 0);
    EXPECT_EQ(jacobian_report(jacobian_determinant(field)).folded_mm3, report.folded_mm3);
    mask.voxels.setTo(0);
    EXPECT_THROW(field_jacobians(field, &mask), InvalidInput);
    field.data<cv::Vec3f>()[30][1] = std::nanf("");
    EXPECT_THROW(field_jacobians(field), InvalidInput);
}

class LandmarkFile : public ::testing::Test {
protected:
    std::filesystem::path write(const std::string& name, const std::string& text) {
        const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
        const auto path = std::filesystem::path(::testing::TempDir()) / (std::string(test->name()) + "_" + name);
        std::ofstream(path, std::ios::binary) << text;
        written_.push_back(path);
        return path;
    }
    /// The message with which reading is refused.
    template <class Read>
    std::string refusal(const Read& read) {
        try {
            read();
        } catch (const Error& error) {
            return error.what();
        }
        return "accepted";
    }
    std::string csv_refusal(const std::string& text) {
        const auto path = write("bad.csv", text);
        return refusal([&] { read_landmarks(path); });
    }
    void TearDown() override {
        for (const auto& path : written_) std::filesystem::remove(path);
    }

private:
    std::vector<std::filesystem::path> written_;
};

TEST_F(LandmarkFile, ReadsColumnsByNameInAnyOrder) {
    const auto path = write("good.csv",
                            "\xEF\xBB\xBFname, intra_x,intra_y,intra_z,pre_x,pre_y,pre_z\r\n"
                            "\"tip\",4,5,6.5,1,-2e0,+3\r\n\r\n"
                            "# a remark\r\n"
                            "base,0,0,0,7,8,9\r\n");
    const Landmarks landmarks = read_landmarks(path);
    ASSERT_EQ(landmarks.moving.cols(), 2);
    EXPECT_EQ(landmarks.moving.col(0), Eigen::Vector3d(1, -2, 3));
    EXPECT_EQ(landmarks.fixed.col(0), Eigen::Vector3d(4, 5, 6.5));
    EXPECT_EQ(landmarks.moving.col(1), Eigen::Vector3d(7, 8, 9));
}

TEST_F(LandmarkFile, RefusesBadTablesWithTheLine) {
    const std::string header = "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n";
    EXPECT_THAT(csv_refusal(""), HasSubstr("empty"));
    EXPECT_THAT(csv_refusal("pre_x,pre_y,pre_z,intra_x,intra_y\n1,2,3,4,5\n"), HasSubstr("bad.csv:1: the header lacks "
                                                                                         "the column intra_z"));
    EXPECT_THAT(csv_refusal(header), HasSubstr("no landmark"));
    EXPECT_THAT(csv_refusal(header + "1,2,3,4,5,6\n1,2,3,4,5\n"), HasSubstr("bad.csv:3: 5 fields"));
    EXPECT_THAT(csv_refusal(header + "1,2,3,4,left,6\n"), HasSubstr("bad.csv:2: intra_y is 'left'"));
    EXPECT_THAT(csv_refusal(header + "1,2,3,4,5mm,6\n"), HasSubstr("bad.csv:2: intra_y is '5mm'"));
    EXPECT_THAT(csv_refusal(header + "1,,3,4,5,6\n"), HasSubstr("bad.csv:2: pre_y is ''"));
    EXPECT_THAT(csv_refusal(header + "1,nan,3,4,5,6\n"), HasSubstr("bad.csv:2: pre_y is nan"));
    EXPECT_THAT(csv_refusal(header + "1,2,3,4,5,inf\n"), HasSubstr("bad.csv:2: intra_z is inf"));
    EXPECT_THROW(read_landmarks("no such file.csv"), IoError);
    EXPECT_THROW(read_landmarks(::testing::TempDir()), IoError);
}

TEST_F(LandmarkFile, ReadsPointFilesOfElastix) {
    const auto moving = write("moving.txt", "point\n2\n-40.94 -47.022 -1169.5\n-98.991 -56.584 -1249.5\n");
    const auto fixed = write("fixed.txt", "point\n2\n1 2 3\n4\t5  6\n");
    const Landmarks landmarks = read_landmarks(moving, fixed);
    ASSERT_EQ(landmarks.fixed.cols(), 2);
    EXPECT_EQ(landmarks.moving.col(0), Eigen::Vector3d(-40.94, -47.022, -1169.5));
    EXPECT_EQ(landmarks.fixed.col(1), Eigen::Vector3d(4, 5, 6));
}

TEST_F(LandmarkFile, RefusesBadPointFilesWithTheLine) {
    const auto good = write("good.txt", "point\n1\n1 2 3\n");
    const auto refused = [&](const std::string& text) {
        const auto path = write("bad.txt", text);
        return refusal([&] { read_landmarks(path, good); });
    };
    EXPECT_THAT(refused(""), HasSubstr("empty"));
    EXPECT_THAT(refused("index\n1\n1 2 3\n"), HasSubstr("bad.txt:1: starts with 'index'"));
    EXPECT_THAT(refused("point\nmany\n1 2 3\n"), HasSubstr("bad.txt:2: the second line"));
    EXPECT_THAT(refused("point\n2\n1 2 3\n"), HasSubstr("promises 2"));
    EXPECT_THAT(refused("point\n1\n1 2\n"), HasSubstr("bad.txt:3: 2 numbers"));
    EXPECT_THAT(refused("point\n1\n1 2 z\n"), HasSubstr("bad.txt:3: z is 'z'"));
    EXPECT_THAT(refused("point\n2\n1 2 3\n1 2 3\n"), HasSubstr("equal numbers"));
}

const char* const slicer_points =
    R"({"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm",
  "controlPoints": [{"label": "tip", "position": [-53.5, -73, 1.25]}, {"label": "base", "position": [4, 5, 6]},
                    {"label": "not yet", "position": [0, 0, 0], "positionStatus": "undefined"}]}]})";

// Left taken for right would still look like landmarks.
TEST_F(LandmarkFile, ReadsPointListsOfSlicerInTheSystemThatTheySay) {
    const auto lps = write("moving.mrk.json", slicer_points);
    std::string text = slicer_points;
    const auto ras = write("fixed.mrk.json", text.replace(text.find("LPS"), 3, "RAS"));
    const Landmarks landmarks = read_landmarks(lps, ras);
    ASSERT_EQ(landmarks.moving.cols(), 2);
    EXPECT_EQ(landmarks.moving.col(0), Eigen::Vector3d(-53.5, -73, 1.25));
    EXPECT_EQ(landmarks.fixed.col(0), Eigen::Vector3d(53.5, 73, 1.25));
}

TEST_F(LandmarkFile, ReadsOldPointListsOfSlicer) {
    const std::string columns = "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n";
    const auto old = write("old.fcsv", "# Markups fiducial file version = 4.10\n# CoordinateSystem = 0\n" + columns +
                                           "vtk_0,1,2,3,0,0,0,1,1,1,0,F-1,,\n");
    const auto recent = write("recent.fcsv", "# Markups fiducial file version = 4.13\n# CoordinateSystem = LPS\n" +
                                                 columns + "0,-1,-2,3,0,0,0,1,1,1,0,F-1,,\n");
    const Landmarks landmarks = read_landmarks(old, recent);
    EXPECT_EQ(landmarks.moving, landmarks.fixed);
    EXPECT_EQ(landmarks.moving.col(0), Eigen::Vector3d(-1, -2, 3));
}

// People place points in any order; a pair by place would be an error of centimetres.
TEST_F(LandmarkFile, PairsPointsByNameWhereBothFilesNameThem) {
    const std::string head = "# CoordinateSystem = LPS\n# columns = x,y,z,label\n";
    const auto moving = write("moving.fcsv", head + "1,0,0,apex\n2,0,0,hilum\n");
    EXPECT_EQ(read_landmarks(moving, write("turned.fcsv", head + "20,0,0,hilum\n10,0,0,apex\n")).fixed.row(0),
              Eigen::RowVector2d(10, 20));
    const auto refused = [&](const std::string& text) {
        return refusal([&] { read_landmarks(moving, write("bad.fcsv", text)); });
    };
    EXPECT_THAT(refused(head + "20,0,0,a\n10,0,0,b\n"), HasSubstr("share no name"));
    EXPECT_THAT(refused(head + "20,0,0,apex\n10,0,0,apex\n"), HasSubstr("two points are named 'apex'"));
    EXPECT_THAT(refused(head + "20,0,0,apex\n10,0,0,\n"), HasSubstr("point 2 has no name"));
}

TEST_F(LandmarkFile, PointsWithoutPartnerAreLeftOutAndNamed) {
    const std::string head = "# CoordinateSystem = LPS\n# columns = x,y,z,label\n";
    tissuewarp::test::Noted noted;
    const Landmarks pairs = read_landmarks(write("m.fcsv", head + "1,0,0,apex\n2,0,0,hilum\n"),
                                           write("f.fcsv", head + "5,0,0,tip\n10,0,0,apex\n"), noted);
    EXPECT_EQ(pairs.moving, Eigen::Vector3d(1, 0, 0));
    EXPECT_EQ(pairs.fixed, Eigen::Vector3d(10, 0, 0));
    EXPECT_THAT(noted.notes, ::testing::AllOf(HasSubstr("hilum"), HasSubstr("tip")));
}

// By order tip would be paired with the hilum, and as many points would be left on both sides.
TEST_F(LandmarkFile, PointsThatWereNotPlacedLeaveThePairsOfTheOthers) {
    const auto markups = [](const std::string& tip, const std::string& apex) {
        return R"({"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": [
            {"label": "tip", "position": [1, 0, 0], "positionStatus": ")" +
               tip + R"("}, {"label": "hilum", "position": [20, 0, 0], "positionStatus": "defined"},
            {"label": "apex", "position": [300, 0, 0], "positionStatus": ")" +
               apex + R"("}, {"label": "base", "position": [4000, 0, 0]}]}]})";
    };
    tissuewarp::test::Noted noted;
    const Landmarks pairs = read_landmarks(write("m.mrk.json", markups("undefined", "defined")),
                                           write("f.mrk.json", markups("defined", "missing")), noted);
    ASSERT_EQ(pairs.moving.cols(), 2);
    EXPECT_EQ(pairs.moving.row(0), Eigen::RowVector2d(20, 4000));
    EXPECT_EQ(pairs.fixed, pairs.moving);
    EXPECT_THAT(noted.notes, ::testing::AllOf(HasSubstr("tip"), HasSubstr("apex")));
}

TEST_F(LandmarkFile, PointsOfSlicerThatDoNotCountAreLeftOutAndNamed) {
    const std::string head =
        "# CoordinateSystem = LPS\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n";
    tissuewarp::test::Noted noted;
    const auto file = write("a.fcsv", head +
                                          "0,1,2,3,0,0,0,1,1,1,0,A,,,2,0\n1,0,0,0,0,0,0,1,1,1,0,B,,,0,0\n"
                                          "2,0,0,0,0,0,0,1,1,1,0,C,,,3,0\n3,7,8,9,0,0,0,1,0,1,0,D,,,2,0\n");
    EXPECT_EQ(read_points(file, noted), Eigen::Vector3d(1, 2, 3));
    EXPECT_THAT(noted.notes,
                ::testing::AllOf(HasSubstr("B (not placed)"), HasSubstr("C (missing)"), HasSubstr("D (hidden)")));
    const auto table = write("a.csv",
                             "label,r,a,s,defined,selected,visible,locked,description\n"
                             "A,-1,-2,3,1,1,1,0,\nB,0,0,0,0,1,1,0,\n");
    noted.notes.clear();
    EXPECT_EQ(read_points(table, noted), Eigen::Vector3d(1, 2, 3));
    EXPECT_THAT(noted.notes, ::testing::AllOf(HasSubstr("r, a, s were turned to LPS"), HasSubstr("left out: B")));
}

TEST_F(LandmarkFile, TablesOfPointsArePairsToo) {
    const auto moving = write("m.csv", "name;z;y;x\na;3,5;2;1\nb;6;5;4\n");
    const auto fixed = write("f.csv", "name,x,y,z\nb,4,5,6\na,1,2,3.5\n");
    const Landmarks pairs = read_landmarks(moving, fixed);
    EXPECT_EQ(pairs.moving, pairs.fixed);
    EXPECT_EQ(pairs.moving.col(0), Eigen::Vector3d(1, 2, 3.5));
    EXPECT_TRUE(is_table_of_pairs(write("p.csv", "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n")));
    EXPECT_FALSE(is_table_of_pairs(fixed));
}

TEST_F(LandmarkFile, ColumnsOfNumbersPairWhereTheyAreNoOrderOfTheirOwn) {
    const auto moving = write("m.csv", "id,x,y,z\n1,1,2,3\n2,4,5,6\n"),
               shuffled = write("s.csv", "ID,x,y,z\n2,4,5,6\n1,1,2,3\n"),
               from_zero = write("z.csv", "id,x,y,z\n0,1,2,3\n1,4,5,6\n"),
               fewer = write("f.csv", "id,x,y,z\n1,1,2,3\n");
    EXPECT_EQ(read_landmarks(moving, shuffled).fixed, read_landmarks(moving, moving).moving);
    EXPECT_EQ(read_landmarks(moving, from_zero).fixed, read_landmarks(moving, moving).moving);
    EXPECT_THAT(refusal([&] { read_landmarks(moving, fewer); }), HasSubstr("equal numbers"));
}

TEST_F(LandmarkFile, TablesOfPairsHaveRemarksAndRowsThatDoNotCount) {
    const std::string header = "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z";
    tissuewarp::test::Noted noted;
    const Landmarks turned =
        read_landmarks(write("p.csv", "# CoordinateSystem = RAS\n" + header + "\n1,2,3,4,5,6\n"), noted);
    EXPECT_EQ(turned.moving.col(0), Eigen::Vector3d(-1, -2, 3));
    EXPECT_EQ(turned.fixed.col(0), Eigen::Vector3d(-4, -5, 6));
    EXPECT_THAT(noted.notes, HasSubstr("says that its points are RAS"));
    noted.notes.clear();
    const Landmarks pairs =
        read_landmarks(write("d.csv", "label," + header +
                                          ",defined,intra_visible\na,1,2,3,4,5,6,1,1\nb,0,0,0,0,0,0,0,1\n"
                                          "c,0,0,0,0,0,0,True,False\n"),
                       noted);
    EXPECT_EQ(pairs.moving.cols(), 1);
    EXPECT_THAT(noted.notes, HasSubstr("left out: b, c"));
    EXPECT_THAT(csv_refusal("# unit: cm\n" + header + "\n1,2,3,4,5,6\n"), HasSubstr("its unit is cm"));
}

// Of a list that lacks a point, all behind it would be paired with their neighbours.
TEST_F(LandmarkFile, PairsByOrderHaveNoGap) {
    const auto whole = write("m.csv", "x,y,z\n1,2,3\n4,5,6\n");
    const auto refused = [&](const std::string& text) {
        return refusal([&] { read_landmarks(whole, write("f.csv", text)); });
    };
    EXPECT_THAT(refused("x,y,z\n1,2,3\n\n4,5,6\n"), HasSubstr("f.csv:3: the line is empty, and points are pairs"));
    EXPECT_THAT(refused("x,y,z\n1,2,3\n,,\n4,5,6\n"), HasSubstr("f.csv:3: the row is empty"));
    const auto named = write("n.csv", "x,y,z,name\n1,2,3,a\n\n4,5,6,b\n");
    EXPECT_EQ(read_landmarks(named, named).fixed.cols(), 2);
}

TEST_F(LandmarkFile, PointsInMetresAreRefusedAsSurfacesAre) {
    const std::string rows = "0.02 -0.04 -0.003\n-0.03 0.03 0.005\n0.04 0.1 0.02\n";
    const auto metres = write("m.csv", rows), elastix = write("m.txt", "point\n3\n" + rows);
    const auto pairs = write("pairs.csv",
                             "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n20,-40,-3,0.02,-0.04,-0.003\n"
                             "-30,30,5,-0.03,0.03,0.005\n");
    const auto slicer = write("good.mrk.json", slicer_points);
    EXPECT_THAT(refusal([&] { (void)read_points(metres); }), HasSubstr("m.csv: the points are about 0.1"));
    EXPECT_THAT(refusal([&] { (void)read_points(elastix); }), HasSubstr("are these in metres?"));
    EXPECT_THAT(refusal([&] { read_landmarks(slicer, metres); }), HasSubstr("m.csv: the points are"));
    EXPECT_THAT(refusal([&] { read_landmarks(pairs); }), HasSubstr("pairs.csv: the landmarks are"));
    EXPECT_EQ(read_points(write("near.csv", "1 2 3\n1.5 2 3\n1 2.5 3\n")).cols(), 3);
}

TEST_F(LandmarkFile, RefusesPointListsOfSlicerThatDoNotSayEnough) {
    const auto good = write("good.mrk.json", slicer_points);
    const auto refused = [&](const std::string& name, const std::string& text) {
        const auto path = write(name, text);
        return refusal([&] { read_landmarks(path, good); });
    };
    const auto changed = [&](const std::string& from, const std::string& to) {
        std::string text = slicer_points;
        return refused("bad.mrk.json", text.replace(text.find(from), from.size(), to));
    };
    EXPECT_THAT(refused("bad.mrk.json", "{"), HasSubstr("is no JSON"));
    EXPECT_THAT(refused("bad.mrk.json", "{}"), HasSubstr("has no \"markups\""));
    EXPECT_THAT(refused("bad.mrk.json", "[1]"), HasSubstr("has no \"markups\""));
    EXPECT_THAT(changed("coordinateSystem", "system"), HasSubstr("list 1: has no coordinateSystem"));
    EXPECT_THAT(changed("LPS", "IJK"), HasSubstr("the coordinate system is 'IJK'"));
    EXPECT_THAT(changed("\"mm\"", "\"cm\""), HasSubstr("coordinateUnits is \"cm\""));
    EXPECT_THAT(changed("\"mm\"", R"(["mm", "mm", "cm"])"), HasSubstr(R"(coordinateUnits is ["mm","mm","cm"])"));
    EXPECT_EQ(changed("\"mm\"", R"(["mm", "UCUM", "millimeter"])"), "accepted");
    EXPECT_THAT(changed("[4, 5, 6]", "[4, 5]"), HasSubstr("point 2: has no position of three numbers"));
    EXPECT_THAT(changed("[4, 5, 6]", "[4, 5, null]"), HasSubstr("point 2: position holds null"));
    EXPECT_THAT(changed("[4, 5, 6]", "[4, 5, 1e300]"), HasSubstr("a finite coordinate"));
    EXPECT_THAT(changed("\"base\"", "7"), HasSubstr("is no point list of 3D Slicer"));
    EXPECT_THAT(refused("bad.fcsv", "# columns = x,y,z,label\n1,2,3,F-1\n"), HasSubstr("bad.fcsv:2: no line"));
    EXPECT_THAT(refused("bad.fcsv", "# CoordinateSystem = LPS\n# columns = x,y,label\n1,2,F\n"),
                HasSubstr("bad.fcsv:3: z is ''"));
    EXPECT_THAT(refused("bad.fcsv", "# CoordinateSystem = LPS\n"), HasSubstr("holds no placed point"));
    EXPECT_THROW(read_slicer_markups("no such file.mrk.json"), IoError);
}

}  // namespace
}  // namespace tissuewarp::registration
