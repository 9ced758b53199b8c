/// DICOM series that the test writes itself, byte by byte, so that no library vouches for its own mistakes.

#include "core/errors.hpp"
#include "dicom_elements.hpp"
#include "imaging/image_io.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <fstream>

namespace tissuewarp::imaging {
namespace {

using test::decimals;
using test::Elements;
using test::message_of;
using test::TemporaryFolder;
using testing::HasSubstr;

struct SliceOptions {
    std::string series = "1.2.3.4";
    double slope = 1.0, intercept = 0.0;
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();  ///< of this slice's position, mm
    double thickness = 0.0;                           ///< mm, that of the grid when 0
    bool placed = true;                               ///< states position and orientation
    std::string image_type = "ORIGINAL\\PRIMARY";
    std::string pixel_spacing = "";  ///< that of the grid when empty
    bool has_pixels = true;
    bool has_table = false;  ///< of values, Modality LUT Sequence
};

/// Slice k of an int16 volume as a CT image.
void write_slice(const std::filesystem::path& path, const Volume& volume, int k, const SliceOptions& options = {}) {
    const Geometry& grid = volume.geometry;
    const std::string instance = std::string("1.2.3.9.") + std::to_string(k + 1),
                      image_class = "1.2.840.10008.5.1.4.1.1.2";
    Eigen::VectorXd axes(6);
    axes << grid.direction.col(0), grid.direction.col(1);
    const Eigen::Vector3d position = grid.point({0, 0, 1.0 * k}) + options.shift;
    Elements data;
    data.text(8, 8, "CS", options.image_type);
    data.text(8, 0x16, "UI", image_class);
    data.text(8, 0x18, "UI", instance);
    data.text(8, 0x60, "CS", "CT");
    data.text(0x18, 0x50, "DS",
              decimals(Eigen::VectorXd::Constant(1, options.thickness > 0 ? options.thickness : grid.spacing[2])));
    data.text(0x20, 0xd, "UI", "1.2.3");
    data.text(0x20, 0xe, "UI", options.series);
    data.text(0x20, 0x11, "IS", "1");
    data.text(0x20, 0x13, "IS", std::to_string(k + 1));
    if (options.placed) data.text(0x20, 0x32, "DS", decimals(position));
    if (options.placed) data.text(0x20, 0x37, "DS", decimals(axes));
    data.short_value(0x28, 2, 1);
    data.text(0x28, 4, "CS", "MONOCHROME2");
    data.short_value(0x28, 0x10, grid.size[1]);
    data.short_value(0x28, 0x11, grid.size[0]);
    // Row spacing first: the distance between rows is the spacing along j.
    data.text(0x28, 0x30, "DS",
              options.pixel_spacing.empty() ? decimals(Eigen::Vector2d(grid.spacing[1], grid.spacing[0]))
                                            : options.pixel_spacing);
    data.short_value(0x28, 0x100, 16);
    data.short_value(0x28, 0x101, 16);
    data.short_value(0x28, 0x102, 15);
    data.short_value(0x28, 0x103, 1);
    data.text(0x28, 0x1052, "DS", decimals(Eigen::VectorXd::Constant(1, options.intercept)));
    data.text(0x28, 0x1053, "DS", decimals(Eigen::VectorXd::Constant(1, options.slope)));
    Elements table;
    table.text(0x28, 0x3004, "LO", "HU");
    if (options.has_table) data.sequence(0x28, 0x3000, {table});
    const std::int16_t* first = volume.data<short>() + volume.offset(0, 0, k);
    if (options.has_pixels) data.words(0x7fe0, 0x10, {first, first + grid.size[0] * grid.size[1]});

    test::write_dicom(path, image_class, instance, data);
}

std::string reversed_name(int k, int count) {
    return std::string("slice") + std::to_string(100 + count - k) + ".dcm";
}

Volume ct_volume() {
    return test::random_volume(test::oblique_grid({7, 9, 6}), CV_16S);
}

TEST(DicomSeries, AnObliqueSeriesWithReversedNamesIsReadInPlace) {
    const TemporaryFolder folder;
    const Volume volume = ct_volume();
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), volume, k);
    const Volume read = read_volume(folder.path());
    EXPECT_TRUE(test::same_voxels(read.voxels, volume.voxels));
    EXPECT_LT(grid_distance(volume.geometry, read.geometry), 1e-5);
    EXPECT_NEAR(read.geometry.spacing[2], 2.5, 1e-6);
}

TEST(DicomSeries, RescaleSlopeAndInterceptAreApplied) {
    const TemporaryFolder folder;
    const Volume volume = ct_volume();
    for (int k = 0; k < 6; ++k)
        write_slice(folder / reversed_name(k, 6), volume, k, {.slope = 2.0, .intercept = -1024.0});
    const Volume read = read_volume(folder.path()).as(CV_64F);
    for (long long i = 0; i < volume.geometry.voxel_count(); ++i)
        ASSERT_EQ(read.data<double>()[i], 2.0 * volume.data<short>()[i] - 1024.0);
}

TEST(DicomSeries, SlopesThatDifferFromSliceToSliceAreEachApplied) {
    const TemporaryFolder folder;
    const Volume volume = ct_volume();
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), volume, k, {.slope = 1.0 + 0.25 * k});
    const Volume read = read_volume(folder.path()).as(CV_64F);
    for (int k = 0; k < 6; ++k) {
        const auto at = volume.offset(3, 4, k);
        EXPECT_NEAR(read.data<double>()[at], (1.0 + 0.25 * k) * volume.data<short>()[at], 1e-4);
    }
}

TEST(DicomSeries, ATableOfValuesIsRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), ct_volume(), k, {.has_table = true});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("Modality LUT Sequence"));
}

TEST(DicomSeries, AMissingSliceIsRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k)
        if (k != 3) write_slice(folder / reversed_name(k, 6), ct_volume(), k);
    const std::string message = message_of<InvalidInput>([&] { read_volume(folder.path()); });
    EXPECT_THAT(message, HasSubstr("slices are missing or uneven: 5 mm"));
    EXPECT_THAT(message, HasSubstr(folder.path().string()));
}

// 2.5 mm between slices: two roundings to 0.1 mm differ by up to 4 % of it.
TEST(DicomSeries, PositionsRoundedToATenthOfAMillimetreAreAnEvenStackAndAGapIsNone) {
    constexpr std::array rounding{0.04, -0.05, 0.05, -0.04, 0.05, -0.05};
    const TemporaryFolder folder;
    const Volume volume = ct_volume();
    for (int k = 0; k < 6; ++k)
        write_slice(folder / reversed_name(k, 6), volume, k,
                    {.shift = rounding[static_cast<std::size_t>(k)] * volume.geometry.direction.col(2)});
    const ReadResult read = read_volume_with_notes(folder.path());
    EXPECT_TRUE(test::same_voxels(read.volume.voxels, volume.voxels));
    EXPECT_LT(grid_distance(volume.geometry, read.volume.geometry), 0.02);
    EXPECT_THAT(read.notes, testing::ElementsAre(HasSubstr("off even steps of 2.4")));
    for (const int missing : {1, 3}) {
        const TemporaryFolder gap;
        for (int k = 0; k < 6; ++k)
            if (k != missing) std::filesystem::copy_file(folder / reversed_name(k, 6), gap / reversed_name(k, 6));
        EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(gap.path()); }), HasSubstr("missing or uneven"));
    }
}

TEST(DicomSeries, NumbersThatAreNoneAndSlicesWithoutPixelsAreNamed) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k)
        write_slice(folder / reversed_name(k, 6), ct_volume(), k, {.pixel_spacing = "0,75\\0,75"});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }),
                HasSubstr("Pixel Spacing is '0,75\\0,75' where 2 numbers with decimal points belong"));
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), ct_volume(), k, {.has_pixels = k != 4});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }),
                testing::AllOf(HasSubstr(reversed_name(4, 6)), HasSubstr("holds no pixels")));
}

TEST(DicomSeries, TwoSeriesInOneFolderAreRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k) {
        write_slice(folder / (std::string("a") + std::to_string(k) + ".dcm"), ct_volume(), k);
        write_slice(folder / (std::string("b") + std::to_string(k) + ".dcm"), ct_volume(), k, {.series = "1.2.3.5"});
    }
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("2 series"));
}

TEST(DicomSeries, DoubledSlicesAreRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), ct_volume(), k);
    write_slice(folder / "again.dcm", ct_volume(), 2);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("same position"));
}

TEST(DicomSeries, GantryTiltIsRefused) {
    const TemporaryFolder folder;
    const Volume volume = ct_volume();
    for (int k = 0; k < 6; ++k)
        write_slice(folder / reversed_name(k, 6), volume, k, {.shift = 0.5 * k * volume.geometry.direction.col(1)});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("gantry tilt"));
}

TEST(DicomSeries, ATiltOfLittleMoreThanATenthOfAPixelOverTheStackIsRefused) {
    const TemporaryFolder folder;
    const Volume volume = ct_volume();  // pixels of 0.75 mm, 5 steps
    for (const double shift : {0.01, 0.02}) {
        for (int k = 0; k < 6; ++k)
            write_slice(folder / reversed_name(k, 6), volume, k,
                        {.shift = shift * k * volume.geometry.direction.col(1)});
        if (shift < 0.015)
            EXPECT_EQ(read_volume(folder.path()).geometry.size[2], 6);
        else
            EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("mm over the stack"));
    }
}

TEST(DicomSeries, ThicknessesThatDifferByRoundingAreOneSeries) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k)
        write_slice(folder / reversed_name(k, 6), ct_volume(), k, {.thickness = 2.5 + 1e-6 * k});
    EXPECT_TRUE(test::same_voxels(read_volume(folder.path()).voxels, ct_volume().voxels));
}

TEST(DicomSeries, SlicesWithoutPositionsAndMosaicsAreRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), ct_volume(), k, {.placed = false});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("secondary capture"));
    for (int k = 0; k < 6; ++k)
        write_slice(folder / reversed_name(k, 6), ct_volume(), k, {.image_type = "ORIGINAL\\PRIMARY\\M\\MOSAIC"});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("mosaic"));
}

TEST(DicomSeries, OneSliceGivenAsAFileAsksForItsFolder) {
    const TemporaryFolder folder;
    write_slice(folder / "slice", ct_volume(), 0);
    EXPECT_TRUE(is_image(folder / "slice"));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "slice"); }), HasSubstr("give the folder"));
}

TEST(DicomSeries, AFolderWithoutImagesIsRefused) {
    const TemporaryFolder folder;
    EXPECT_THROW(read_volume(folder.path()), InvalidInput);
    std::ofstream(folder / "readme.txt") << "no image";
    EXPECT_THROW(read_volume(folder.path()), InvalidInput);
}

TEST(DicomSeries, ATruncatedSliceIsAnError) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k) write_slice(folder / reversed_name(k, 6), ct_volume(), k);
    const auto path = folder / reversed_name(2, 6);
    std::filesystem::resize_file(path, std::filesystem::file_size(path) - 60);
    EXPECT_THROW(read_volume(folder.path()), Error);
}

}  // namespace
}  // namespace tissuewarp::imaging
