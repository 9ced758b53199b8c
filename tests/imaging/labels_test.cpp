#include "imaging/labels.hpp"
#include "core/errors.hpp"
#include "imaging/label_extents.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <queue>

namespace tissuewarp::imaging {
namespace {

using test::message_of;
using testing::ElementsAre;

void fill_box(Volume& labels, std::array<int, 3> lower, std::array<int, 3> upper, int label) {
    for (int k = lower[2]; k < upper[2]; ++k)
        for (int j = lower[1]; j < upper[1]; ++j)
            for (int i = lower[0]; i < upper[0]; ++i) labels.data<int>()[labels.offset(i, j, k)] = label;
}

Volume two_boxes() {
    Volume labels(test::oblique_grid({20, 20, 20}), CV_32S);
    fill_box(labels, {2, 3, 4}, {6, 9, 7}, 5);      // 4 * 6 * 3 = 72 voxels
    fill_box(labels, {10, 0, 10}, {12, 2, 12}, 9);  // 8 voxels on the border
    fill_box(labels, {15, 15, 15}, {16, 16, 16}, 5);
    return labels;
}

/// Components by breadth-first search, numbered as the interface says.
std::vector<int> brute_force_sizes(const Volume& mask) {
    const auto [nx, ny, nz] = mask.geometry.size;
    std::vector<char> seen(static_cast<std::size_t>(mask.geometry.voxel_count()));
    std::vector<int> sizes;
    for (int start = 0; start < nx * ny * nz; ++start) {
        if (!mask.data<std::uint8_t>()[start] || seen[static_cast<std::size_t>(start)]) continue;
        std::queue<int> queue({start});
        seen[static_cast<std::size_t>(start)] = 1;
        int size = 0;
        while (!queue.empty()) {
            const int at = queue.front(), i = at % nx, j = at / nx % ny, k = at / nx / ny;
            queue.pop();
            ++size;
            const auto visit = [&](bool exists, int next) {
                if (!exists || !mask.data<std::uint8_t>()[next] || seen[static_cast<std::size_t>(next)]) return;
                seen[static_cast<std::size_t>(next)] = 1;
                queue.push(next);
            };
            visit(i > 0, at - 1), visit(i + 1 < nx, at + 1), visit(j > 0, at - nx);
            visit(j + 1 < ny, at + nx), visit(k > 0, at - nx * ny), visit(k + 1 < nz, at + nx * ny);
        }
        sizes.push_back(size);
    }
    std::sort(sizes.rbegin(), sizes.rend());
    return sizes;
}

TEST(Labels, ListsLabelsWithoutBackground) {
    EXPECT_THAT(labels_in(two_boxes()), ElementsAre(5, 9));
    EXPECT_THAT(labels_in(Volume(test::plain_grid({3, 3, 3}), CV_8U)), ElementsAre());
}

TEST(Labels, StatisticsOfBoxes) {
    const Volume labels = two_boxes();
    const auto statistics = label_statistics(labels);
    ASSERT_EQ(statistics.size(), 2U);
    const LabelStatistics& five = statistics.at(5);
    EXPECT_EQ(five.label, 5);
    EXPECT_EQ(five.voxels, 73);
    EXPECT_DOUBLE_EQ(five.volume_mm3, 73 * 0.75 * 1.25 * 2.5);
    EXPECT_EQ(five.components, 2);
    EXPECT_EQ(five.lower, (std::array<int, 3>{2, 3, 4}));
    EXPECT_EQ(five.upper, (std::array<int, 3>{16, 16, 16}));
    EXPECT_FALSE(five.touches_border);
    const Eigen::Vector3d sum = 72 * Eigen::Vector3d(3.5, 5.5, 5.0) + Eigen::Vector3d(15, 15, 15);
    EXPECT_LT((five.centroid - labels.geometry.point(sum / 73)).norm(), 1e-10);
    EXPECT_EQ(statistics.at(9).components, 1);
    EXPECT_TRUE(statistics.at(9).touches_border);
}

TEST(Labels, GreyValuesGiveMeanAndDeviation) {
    Volume labels(test::plain_grid({4, 1, 1}), CV_8U), image(test::plain_grid({4, 1, 1}), CV_16S);
    for (int i = 0; i < 4; ++i) {
        labels.data<std::uint8_t>()[i] = i < 3 ? 1 : 0;
        image.data<short>()[i] = static_cast<short>(10000 + 3 * i);
    }
    const auto statistics = label_statistics(labels, &image);
    EXPECT_DOUBLE_EQ(statistics.at(1).mean, 10003.0);
    EXPECT_DOUBLE_EQ(statistics.at(1).standard_deviation, std::sqrt(6.0));
}

TEST(Labels, AnImageOnAnotherGridIsRefused) {
    const Volume image(test::plain_grid({20, 20, 20}), CV_8U);
    EXPECT_THROW(label_statistics(two_boxes(), &image), InvalidInput);
}

TEST(Labels, TouchingLabelsAreSeparatePieces) {
    Volume labels(test::plain_grid({4, 1, 1}), CV_32S);
    for (int i = 0; i < 4; ++i) labels.data<int>()[i] = i < 2 ? 1 : 2;
    const auto statistics = label_statistics(labels);
    EXPECT_EQ(statistics.at(1).components, 1);
    EXPECT_EQ(statistics.at(2).components, 1);
}

TEST(Labels, MasksHoldOnesOfOneLabelOrAll) {
    const Volume labels = two_boxes();
    EXPECT_EQ(cv::countNonZero(mask_of(labels, 9).voxels.reshape(1, 1)), 8);
    EXPECT_EQ(cv::sum(mask_of_all(labels).voxels)[0], 81.0);
    EXPECT_EQ(mask_of(labels, 9).voxels.type(), CV_8UC1);
}

TEST(Labels, ComponentsAreNumberedByFallingSize) {
    const Volume components = connected_components(two_boxes());
    EXPECT_EQ(components.voxels.type(), CV_32SC1);
    EXPECT_EQ(components.data<int>()[components.offset(3, 5, 5)], 1);
    EXPECT_EQ(components.data<int>()[components.offset(10, 1, 11)], 2);
    EXPECT_EQ(components.data<int>()[components.offset(15, 15, 15)], 3);
    EXPECT_EQ(components.data<int>()[0], 0);
}

TEST(Labels, DiagonalNeighboursAreApart) {
    Volume mask(test::plain_grid({2, 2, 2}), CV_8U);
    mask.data<std::uint8_t>()[mask.offset(0, 0, 0)] = mask.data<std::uint8_t>()[mask.offset(1, 1, 0)] = 1;
    EXPECT_EQ(label_statistics(mask).at(1).components, 2);
}

TEST(Labels, ComponentsAgreeWithBreadthFirstSearchOnRandomMasks) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
        Volume mask = test::random_volume(test::plain_grid({17, 13, 19}), CV_8U, seed);
        for (long long i = 0; i < mask.geometry.voxel_count(); ++i)  // 35 %: just above the percolation threshold
            mask.data<std::uint8_t>()[i] = mask.data<std::uint8_t>()[i] < 35 ? 1 : 0;
        const Volume components = connected_components(mask);
        std::map<int, int> counted;
        for (long long i = 0; i < mask.geometry.voxel_count(); ++i) {
            const int number = components.data<int>()[i];
            ASSERT_EQ(number != 0, mask.data<std::uint8_t>()[i] != 0);
            if (number) ++counted[number];
        }
        std::vector<int> sizes;
        for (const auto& [number, size] : counted) sizes.push_back(size);
        EXPECT_EQ(sizes, brute_force_sizes(mask));
    }
}

TEST(Labels, LargestComponentDropsTheRest) {
    EXPECT_EQ(cv::sum(largest_component(two_boxes()).voxels)[0], 72.0);
}

TEST(Labels, RequiredLabelsAreNamedWhenAbsent) {
    EXPECT_NO_THROW(require_labels(two_boxes(), {5, 9}, "preop labels"));
    const std::string message = message_of<InvalidInput>([] { require_labels(two_boxes(), {5, 7}, "preop labels"); });
    EXPECT_EQ(message, "preop labels: label 7 is absent; present are 5, 9");
    EXPECT_THROW(require_labels(Volume(test::plain_grid({3, 3, 3}), CV_8U), {}, "labels"), InvalidInput);
}

TEST(LabelExtents, AreThoseOfTheStatistics) {
    const Volume labels = two_boxes();
    const auto statistics = label_statistics(labels);
    for (const int depth : {CV_8U, CV_8S, CV_16U, CV_16S, CV_32S}) {
        const LabelExtents extents = label_extents(labels.as(depth));
        ASSERT_EQ(extents.size(), statistics.size());
        for (const auto& [label, expected] : statistics) {
            EXPECT_EQ(extents.at(label).voxels, expected.voxels);
            EXPECT_EQ(extents.at(label).lower, expected.lower);
            EXPECT_EQ(extents.at(label).upper, expected.upper);
        }
    }
    const LabelExtent all = extent_of_all(label_extents(labels));
    EXPECT_EQ(all.voxels, 72 + 8 + 1);
    EXPECT_THAT(all.lower, ElementsAre(2, 0, 4));
    EXPECT_THAT(all.upper, ElementsAre(16, 16, 16));
    EXPECT_EQ(extent_of_all({}).voxels, 0);
    EXPECT_THROW(label_extents(labels.as(CV_32F)), InvalidInput);
}

TEST(LabelExtents, APartKeepsItsPlaces) {
    const Volume labels = two_boxes();
    const LabelExtent box = grown(label_extents(labels).at(9), {3, 3, 3}, labels.geometry);
    const Volume part = part_of(labels.as(CV_8U), box);
    EXPECT_THAT(part.geometry.size, ElementsAre(8, 5, 8));  // the image ends before a margin of three in y
    const Eigen::Vector3d there = part.geometry.index(labels.geometry.point({11, 1, 11}));
    EXPECT_LT((there - Eigen::Vector3d(4, 1, 4)).norm(), 1e-9);
    EXPECT_EQ(part.data<int>()[part.offset(4, 1, 4)], 9);
    EXPECT_EQ(label_extents(part).at(9).voxels, 8);
    EXPECT_THROW(part_of(labels, {1, {0, 0, 0}, {21, 1, 1}}), InvalidInput);
    EXPECT_THROW(part_of(labels, {1, {3, 0, 0}, {3, 1, 1}}), InvalidInput);
}

TEST(LabelExtents, EveryNthVoxel) {
    const Volume labels = two_boxes();
    const Volume part = part_of(labels, {1, {1, 0, 2}, {20, 20, 20}}, {3, 2, 4});
    EXPECT_THAT(part.geometry.size, ElementsAre(7, 10, 5));
    for (int k = 0; k < 5; ++k)
        for (int j = 0; j < 10; ++j)
            for (int i = 0; i < 7; ++i) {
                const int expected = labels.data<int>()[labels.offset(1 + 3 * i, 2 * j, 2 + 4 * k)];
                ASSERT_EQ(part.data<int>()[part.offset(i, j, k)], expected);
            }
    const Eigen::Vector3d last = labels.geometry.index(part.geometry.point({6, 9, 4}));
    EXPECT_LT((last - Eigen::Vector3d(19, 18, 18)).norm(), 1e-9);
}

TEST(LabelExtents, AMaskInABox) {
    const Volume labels = two_boxes();
    const LabelExtent all{1, {0, 0, 0}, {20, 20, 20}};
    for (const int label : {5, 9, 7, 300}) {
        const Volume expected = mask_of(labels, label), mask = mask_in(labels.as(CV_8U), all, label);
        EXPECT_EQ(cv::norm(mask.voxels.reshape(1, 1), expected.voxels.reshape(1, 1), cv::NORM_INF), 0) << label;
    }
    EXPECT_EQ(cv::countNonZero(mask_in(labels, all, 0).voxels.reshape(1, 1)), 72 + 8 + 1);
}

}  // namespace
}  // namespace tissuewarp::imaging
