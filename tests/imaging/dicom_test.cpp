/// DICOM series that the test writes itself, byte by byte, so that no library vouches for its own mistakes.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

namespace tissuewarp::imaging {
namespace {

using test::message_of;
using test::TemporaryFolder;
using testing::HasSubstr;

/// Data elements in explicit little-endian transfer syntax (DICOM PS3.5, section 7.1.2).
class Elements {
public:
    void text(int group, int element, const char* representation, std::string value) {
        if (value.size() % 2) value += std::string(representation) == "UI" ? '\0' : ' ';
        head(group, element, representation);
        number<std::uint16_t>(static_cast<std::uint16_t>(value.size()));
        bytes_ += value;
    }
    void short_value(int group, int element, int value) {
        head(group, element, "US");
        number<std::uint16_t>(2);
        number<std::uint16_t>(static_cast<std::uint16_t>(value));
    }
    void long_value(int group, int element, std::uint32_t value) {
        head(group, element, "UL");
        number<std::uint16_t>(4);
        number(value);
    }
    void words(int group, int element, const std::vector<std::int16_t>& values) {
        head(group, element, "OW");
        number<std::uint16_t>(0);
        number(static_cast<std::uint32_t>(2 * values.size()));
        for (const std::int16_t value : values) number(value);
    }
    const std::string& bytes() const { return bytes_; }

private:
    template <class T>
    void number(T value) {
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    }
    void head(int group, int element, const char* representation) {
        number(static_cast<std::uint16_t>(group));
        number(static_cast<std::uint16_t>(element));
        bytes_ += representation;
    }
    std::string bytes_;
};

std::string decimals(const Eigen::VectorXd& values) {
    std::ostringstream text;
    text.precision(9);
    for (Eigen::Index i = 0; i < values.size(); ++i) text << (i ? "\\" : "") << values[i];
    return text.str();
}

struct SliceOptions {
    std::string series = "1.2.3.4";
    double slope = 1.0, intercept = 0.0;
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();  ///< of this slice's position, mm
};

/// Slice k of an int16 volume as a CT image.
void write_slice(const std::filesystem::path& path, const Volume& volume, int k, const SliceOptions& options = {}) {
    const Geometry& grid = volume.geometry;
    const std::string instance = "1.2.3.9." + std::to_string(k + 1), image_class = "1.2.840.10008.5.1.4.1.1.2";
    Elements meta;
    meta.text(2, 2, "UI", image_class);
    meta.text(2, 3, "UI", instance);
    meta.text(2, 0x10, "UI", "1.2.840.10008.1.2.1");
    Elements length;
    length.long_value(2, 0, static_cast<std::uint32_t>(meta.bytes().size()));

    Eigen::VectorXd axes(6);
    axes << grid.direction.col(0), grid.direction.col(1);
    const Eigen::Vector3d position = grid.point({0, 0, 1.0 * k}) + options.shift;
    Elements data;
    data.text(8, 0x16, "UI", image_class);
    data.text(8, 0x18, "UI", instance);
    data.text(8, 0x60, "CS", "CT");
    data.text(0x18, 0x50, "DS", decimals(Eigen::VectorXd::Constant(1, grid.spacing[2])));
    data.text(0x20, 0xd, "UI", "1.2.3");
    data.text(0x20, 0xe, "UI", options.series);
    data.text(0x20, 0x11, "IS", "1");
    data.text(0x20, 0x13, "IS", std::to_string(k + 1));
    data.text(0x20, 0x32, "DS", decimals(position));
    data.text(0x20, 0x37, "DS", decimals(axes));
    data.short_value(0x28, 2, 1);
    data.text(0x28, 4, "CS", "MONOCHROME2");
    data.short_value(0x28, 0x10, grid.size[1]);
    data.short_value(0x28, 0x11, grid.size[0]);
    // Row spacing first: the distance between rows is the spacing along j.
    data.text(0x28, 0x30, "DS", decimals(Eigen::Vector2d(grid.spacing[1], grid.spacing[0])));
    data.short_value(0x28, 0x100, 16);
    data.short_value(0x28, 0x101, 16);
    data.short_value(0x28, 0x102, 15);
    data.short_value(0x28, 0x103, 1);
    data.text(0x28, 0x1052, "DS", decimals(Eigen::VectorXd::Constant(1, options.intercept)));
    data.text(0x28, 0x1053, "DS", decimals(Eigen::VectorXd::Constant(1, options.slope)));
    const std::int16_t* first = volume.data<short>() + volume.offset(0, 0, k);
    data.words(0x7fe0, 0x10, {first, first + grid.size[0] * grid.size[1]});

    std::ofstream file(path, std::ios::binary);
    file << std::string(128, '\0') << "DICM" << length.bytes() << meta.bytes() << data.bytes();
}

std::string reversed_name(int k, int count) {
    return "slice" + std::to_string(100 + count - k) + ".dcm";
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

TEST(DicomSeries, AMissingSliceIsRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k)
        if (k != 3) write_slice(folder / reversed_name(k, 6), ct_volume(), k);
    const std::string message = message_of<InvalidInput>([&] { read_volume(folder.path()); });
    EXPECT_THAT(message, HasSubstr("slices are missing or uneven: 5 mm"));
    EXPECT_THAT(message, HasSubstr(folder.path().string()));
}

TEST(DicomSeries, TwoSeriesInOneFolderAreRefused) {
    const TemporaryFolder folder;
    for (int k = 0; k < 6; ++k) {
        write_slice(folder / ("a" + std::to_string(k) + ".dcm"), ct_volume(), k);
        write_slice(folder / ("b" + std::to_string(k) + ".dcm"), ct_volume(), k, {.series = "1.2.3.5"});
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
