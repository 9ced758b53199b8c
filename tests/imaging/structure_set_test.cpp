/// DICOM contours that the tests write themselves.
#include "imaging/image_io.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "tests/imaging/dicom_contours.hpp"
#include "tests/imaging/test_volumes.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace tissuewarp::imaging {
namespace {

using namespace test;
using Eigen::Vector3d;
using testing::HasSubstr;

/// In the plane at a height, with so many corners, area that of the circle.
Contour circle(const Vector3d& middle, double radius, int corners = 180) {
    Contour contour;
    const double step = 2 * EIGEN_PI / corners, corner = radius * std::sqrt(step / std::sin(step));
    for (int n = 0; n < corners; ++n)
        contour.points.emplace_back(middle + corner * Vector3d(std::cos(n * step), std::sin(n * step), 0));
    return contour;
}

/// What planes at these heights show of a ball.
std::vector<Contour> ball(const Vector3d& middle, double radius, const std::vector<double>& heights) {
    std::vector<Contour> contours;
    for (const double z : heights)
        if (const double square = radius * radius - (z - middle[2]) * (z - middle[2]); square > 1)
            contours.push_back(circle({middle[0], middle[1], z}, std::sqrt(square)));
    return contours;
}

std::vector<double> heights(double first, double step, int count) {
    std::vector<double> all;
    for (int n = 0; n < count; ++n) all.push_back(first + n * step);
    return all;
}

std::filesystem::path written(const TemporaryFolder& folder, const std::vector<Region>& regions,
                              const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity()) {
    write_dicom(folder / "rtss.dcm", structure_set_storage, "1.2.3", structure_set(regions, turn));
    return folder / "rtss.dcm";
}

/// Share of the image's voxels where the labels are not what they should be, against the voxels of the region.
double wrong_share(const Volume& labels, const std::function<int(const Vector3d&)>& truth) {
    double wrong = 0, all = 0;
    const auto [nx, ny, nz] = labels.geometry.size;
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) {
                const int is = labels.data<int>()[labels.offset(i, j, k)],
                          should = truth(labels.geometry.point({1.0 * i, 1.0 * j, 1.0 * k}));
                wrong += is != should;
                all += should != 0;
            }
    return wrong / all;
}

const Vector3d middle(12, -30, 105);

TEST(StructureSets, RegionsBecomeLabelsWithNamesAndContoursWithinAreHoles) {
    const TemporaryFolder folder;
    std::vector<Contour> shell = ball(middle, 20, heights(80, 2, 26));
    for (const Contour& hole : ball(middle, 10, heights(80, 2, 26))) shell.push_back(hole);
    const auto path = written(folder, {{3, "shell", shell}, {7, "core", ball(middle, 8, heights(80, 2, 26))}});
    EXPECT_TRUE(is_structure_set(path));
    const ReadResult read = read_labels_with_notes(path);
    EXPECT_EQ(read.label_names, (std::map<int, std::string>{{3, "shell"}, {7, "core"}}));
    EXPECT_EQ(read.volume.geometry.spacing, Vector3d(1, 1, 2));
    const auto statistics = label_statistics(read.volume);
    EXPECT_NEAR(statistics.at(3).volume_mm3, 4 * EIGEN_PI / 3 * (8000 - 1000), 300);
    EXPECT_NEAR(statistics.at(7).volume_mm3, 4 * EIGEN_PI / 3 * 512, 50);
    EXPECT_LT((statistics.at(3).centroid - middle).norm(), 0.3);
    EXPECT_THAT(read.notes, testing::Contains(HasSubstr("planes 2 mm apart")));
}

// On an image turned about the contours' normal and of other slices every voxel is told by its own place.
TEST(StructureSets, AreDrawnOnTheVoxelsOfAnImage) {
    const TemporaryFolder folder;
    const auto path = written(folder, {{1, "ball", ball(middle, 20, heights(80, 3, 18))}});
    const auto truth = [](const Vector3d& point) { return (point - middle).norm() < 20 ? 1 : 0; };
    Geometry grid;
    grid.size = {60, 50, 40};
    grid.spacing = {0.9, 1.1, 1.5};
    grid.direction = Eigen::AngleAxisd(0.4, Vector3d::UnitZ()).toRotationMatrix();
    grid.origin = middle - grid.direction * Vector3d(27, 27, 30);
    const ReadResult read = read_structures_on(path, grid);
    EXPECT_TRUE(same_grid(read.volume.geometry, grid));
    EXPECT_LT(wrong_share(read.volume, truth), 0.055);  // slices between planes are interpolated
    grid.direction = Eigen::AngleAxisd(0.4, Vector3d(1, 1, 1).normalized()).toRotationMatrix();
    grid.origin = middle - grid.direction * Vector3d(27, 27, 30);
    EXPECT_LT(wrong_share(read_structures_on(path, grid).volume, truth), 0.12);  // by the nearest of thick planes
}

TEST(StructureSets, AMissingPlaneIsInterpolatedAndAGapStaysOne) {
    const TemporaryFolder folder;
    std::vector<double> planes = heights(80, 2, 26);
    planes.erase(planes.begin() + 12);  // at 104
    const auto straight = [](const std::vector<double>& at, double radius) {
        std::vector<Contour> contours;
        for (const double z : at) contours.push_back(circle({0, 0, z}, radius));
        return contours;
    };
    const auto lower = straight(heights(80, 2, 5), 10), upper = straight(heights(120, 2, 5), 10);
    std::vector<Contour> both = lower;
    both.insert(both.end(), upper.begin(), upper.end());
    const auto path = written(folder, {{1, "ball", ball(middle, 20, planes)}, {2, "ends", both}});
    EXPECT_NEAR(label_statistics(read_labels(path)).at(1).volume_mm3 / (4 * EIGEN_PI / 3 * 8000), 1, 0.01);
    const auto apart = written(folder, {{2, "ends", both}});
    EXPECT_EQ(label_statistics(read_labels(apart)).at(2).components, 2);
    // every other plane of one region: between two of its own it goes on, for the other one has planes there
    const auto tubes = written(
        folder, {{1, "fine", straight(heights(0, 2, 20), 5)}, {2, "coarse", [&] {
                                                                   std::vector<Contour> moved;
                                                                   for (const double z : heights(0, 4, 10))
                                                                       moved.push_back(circle({40.3, 0.2, z}, 5));
                                                                   return moved;
                                                               }()}});
    const auto statistics = label_statistics(read_labels(tubes));
    EXPECT_EQ(statistics.at(2).components, 1);
    EXPECT_NEAR(statistics.at(2).volume_mm3 / (25 * EIGEN_PI * 38), 1, 0.05);
}

TEST(StructureSets, OfObliqueSlicesAreReadToo) {
    const TemporaryFolder folder;
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(2, -1, 1).normalized()).toRotationMatrix();
    const auto path = written(folder, {{1, "ball", ball(middle, 20, heights(80, 2, 26))}}, turn);
    const auto statistics = label_statistics(read_labels(path));
    EXPECT_NEAR(statistics.at(1).volume_mm3 / (4 * EIGEN_PI / 3 * 8000), 1, 0.02);
    EXPECT_LT((statistics.at(1).centroid - turn * middle).norm(), 0.3);
}

TEST(StructureSets, RegionsThatShareARimAreTakenApartAndOverlapsRefusedByName) {
    const TemporaryFolder folder;
    const auto planes = heights(80, 2, 26);
    const auto near = written(folder, {{1, "liver", ball(middle, 20, planes)},
                                       {2, "spleen", ball(middle + Vector3d(33.5, 0, 0), 15, planes)}});
    const ReadResult read = read_labels_with_notes(near);
    EXPECT_THAT(read.notes, testing::Contains(HasSubstr("'liver' and 'spleen' share")));
    EXPECT_NEAR(label_statistics(read.volume).at(2).volume_mm3 / (4 * EIGEN_PI / 3 * 3375), 1, 0.03);
    const auto within =
        written(folder, {{1, "liver", ball(middle, 20, planes)}, {2, "tumour", ball(middle, 9, planes)}});
    const auto statistics = label_statistics(read_labels(within));
    EXPECT_NEAR(statistics.at(2).volume_mm3 / (4 * EIGEN_PI / 3 * 729), 1, 0.05);
    EXPECT_NEAR(statistics.at(1).volume_mm3 / (4 * EIGEN_PI / 3 * (8000 - 729)), 1, 0.03);
    const auto overlapping = written(
        folder, {{1, "liver", ball(middle, 20, planes)}, {2, "kidney", ball(middle + Vector3d(20, 0, 0), 12, planes)}});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_labels(overlapping); }),
                HasSubstr("regions overlap: 'liver' and 'kidney'"));
}

TEST(StructureSets, OutlinesOfThePatientAndVolumesOfAPlanAreNoTissue) {
    const TemporaryFolder folder;
    const auto planes = heights(80, 2, 26);
    const auto path = written(folder, {{1, "BODY", ball(middle, 24, planes), "EXTERNAL"},
                                       {2, "liver", ball(middle, 15, planes)},
                                       {3, "PTV 50", ball(middle + Vector3d(10, 0, 0), 12, planes), "PTV"}});
    const ReadResult read = read_labels_with_notes(path);
    EXPECT_EQ(labels_in(read.volume), std::vector<int>{2});
    EXPECT_THAT(read.notes, testing::Contains("'BODY' is no tissue (EXTERNAL) and left out"));
}

TEST(StructureSets, WhatEnclosesNothingIsLeftOutOrRefused) {
    const TemporaryFolder folder;
    std::vector<Contour> contours = ball(middle, 10, heights(90, 2, 15));
    contours.push_back({{middle}, "POINT"});
    const auto path = written(folder, {{1, "ball", contours}, {2, "isocentre", {{{middle}, "POINT"}}}});
    EXPECT_THAT(read_labels_with_notes(path).notes,
                testing::AllOf(testing::Contains(HasSubstr("POINT of 'ball'")),
                               testing::Contains(HasSubstr("POINT of 'isocentre'"))));
    const auto refusal = [&](const std::vector<Region>& regions) {
        const auto file = written(folder, regions);
        return message_of<InvalidInput>([&] { read_labels(file); });
    };
    EXPECT_THAT(refusal({{2, "isocentre", {{{middle}, "POINT"}}}}), HasSubstr("no closed contours"));
    EXPECT_THAT(refusal({{1, "flat", {circle(middle, 10)}}}), HasSubstr("one plane"));
    EXPECT_THAT(refusal({{1, "far", {circle(middle, 10), circle(middle + Vector3d(0, 0, 9000), 10)}}}),
                HasSubstr("more than a patient"));
    std::vector<Contour> bent = ball(middle, 10, heights(90, 2, 15));
    bent[3].points[5][2] += 4;
    EXPECT_THAT(refusal({{1, "bent", bent}}), HasSubstr("a contour of 'bent' does not lie in one plane"));
}

}  // namespace
}  // namespace tissuewarp::imaging
