/// Files that must be refused in words, before anything large is allocated.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <limits>
#include <sstream>

namespace tissuewarp::imaging {
namespace {

using test::message_of;
using test::TemporaryFolder;
using testing::HasSubstr;
namespace fs = std::filesystem;

template <class T>
void patch(const fs::path& path, std::streamoff offset, T value) {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(offset);
    file.write(reinterpret_cast<const char*>(&value), sizeof(T));
}

void write_text(const fs::path& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
}

std::string nrrd(const std::string& sizes, const std::string& directions, const std::string& data) {
    return "NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: " + sizes +
           "\nspace directions: " + directions + "\nkinds: domain domain domain\nencoding: raw\n" +
           "space origin: (0,0,0)\n\n" + data;
}

std::string meta(const std::string& sizes, const std::string& spacing, const std::string& data) {
    return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n"
           "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = " +
           spacing + "\nDimSize = " + sizes + "\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + data;
}

Volume some_volume() {
    return test::random_volume(test::oblique_grid({20, 20, 20}), CV_32F);
}

/// One line, with the path in it.
void expect_good_message(const std::string& message, const fs::path& path) {
    EXPECT_THAT(message, HasSubstr(path.string()));
    EXPECT_THAT(message, testing::Not(HasSubstr("\n")));
    EXPECT_THAT(message, HasSubstr(";")) << "no remedy";
}

TEST(BadFiles, AMissingFileIsAnIoError) {
    const std::string message = message_of<IoError>([] { read_volume("/nowhere/image.nii.gz"); });
    expect_good_message(message, "/nowhere/image.nii.gz");
}

TEST(BadFiles, AnUnknownExtensionNamesTheKnownOnes) {
    const TemporaryFolder folder;
    write_text(folder / "image.jpg", "jpg");
    expect_good_message(message_of<InvalidInput>([&] { read_volume(folder / "image.jpg"); }), folder / "image.jpg");
}

class Truncated : public testing::TestWithParam<std::tuple<const char*, double>> {};

TEST_P(Truncated, IsAnIoError) {
    const TemporaryFolder folder;
    const auto& [extension, fraction] = GetParam();
    const auto path = folder / (std::string("cut") + extension);
    write_volume(some_volume(), path);
    fs::resize_file(path, static_cast<std::uintmax_t>(static_cast<double>(fs::file_size(path)) * fraction));
    expect_good_message(message_of<IoError>([&] { read_volume(path); }), path);
}

TEST_P(Truncated, AByteFewerIsAnIoError) {
    const TemporaryFolder folder;
    const auto path = folder / (std::string("cut") + std::get<0>(GetParam()));
    write_volume(some_volume(), path);
    fs::resize_file(path, fs::file_size(path) - 1);
    expect_good_message(message_of<IoError>([&] { read_volume(path); }), path);
}

INSTANTIATE_TEST_SUITE_P(BadFiles, Truncated,
                         testing::Combine(testing::Values(".nii", ".nii.gz", ".nrrd", ".mha"),
                                          testing::Values(0.0, 0.01, 0.5, 0.95)));

class Damaged : public testing::TestWithParam<const char*> {};

TEST_P(Damaged, AFlippedByteInCompressedDataIsAnIoError) {
    const TemporaryFolder folder;
    const auto path = folder / (std::string("flipped") + GetParam());
    write_volume(some_volume(), path);
    const auto middle = static_cast<std::streamoff>(fs::file_size(path) / 2);
    char byte = 0;
    std::ifstream(path, std::ios::binary).seekg(middle).get(byte);
    patch(path, middle, static_cast<char>(byte ^ 0x55));
    expect_good_message(message_of<IoError>([&] { read_volume(path); }), path);
}

INSTANTIATE_TEST_SUITE_P(BadFiles, Damaged, testing::Values(".nii.gz", ".nrrd", ".mha"));

TEST(BadFiles, GarbageIsAnIoErrorInEveryFormat) {
    const TemporaryFolder folder;
    std::string garbage(5000, '\0');
    for (std::size_t i = 0; i < garbage.size(); ++i) garbage[i] = static_cast<char>(i * 7919 % 251);
    for (const char* name : {"a.nii", "a.nii.gz", "a.nrrd", "a.mha"}) {
        write_text(folder / name, garbage);
        expect_good_message(message_of<IoError>([&] { read_volume(folder / name); }), folder / name);
    }
}

TEST(BadFiles, AnEmptyFileIsAnIoErrorInEveryFormat) {
    const TemporaryFolder folder;
    for (const char* name : {"a.nii", "a.nii.gz", "a.nrrd", "a.mha"}) {
        write_text(folder / name, "");
        expect_good_message(message_of<IoError>([&] { read_volume(folder / name); }), folder / name);
    }
}

TEST(BadFiles, TwoDimensionalImagesAreRefused) {
    const TemporaryFolder folder;
    write_volume(some_volume(), folder / "flat.nii");
    patch<short>(folder / "flat.nii", 40, 2);
    expect_good_message(message_of<InvalidInput>([&] { read_volume(folder / "flat.nii"); }), folder / "flat.nii");
    write_text(folder / "flat.mha", meta("4 4 1", "1 1 1", std::string(16, 'a')));
    EXPECT_THROW(read_volume(folder / "flat.mha"), InvalidInput);
    write_text(folder / "flat.nrrd",
               "NRRD0004\ntype: uint8\ndimension: 2\nsizes: 4 4\nencoding: raw\n\n" + std::string(16, 'a'));
    EXPECT_THROW(read_volume(folder / "flat.nrrd"), InvalidInput);
}

TEST(BadFiles, TimeSeriesAreRefusedAndOneTimePointIsNot) {
    const TemporaryFolder folder;
    const Volume volume = test::random_volume(test::plain_grid({4, 4, 4}), CV_8U);
    write_volume(volume, folder / "series.nii");
    patch<short>(folder / "series.nii", 40, 4);
    EXPECT_TRUE(test::same_voxels(read_volume(folder / "series.nii").voxels, volume.voxels));
    patch<short>(folder / "series.nii", 48, 3);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "series.nii"); }), HasSubstr("3 time points"));
}

TEST(BadFiles, ZeroOrInfiniteSpacingIsRefusedInNifti) {
    const TemporaryFolder folder;
    for (const float spacing :
         {0.0F, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
        write_volume(some_volume(), folder / "spacing.nii");
        patch(folder / "spacing.nii", 76 + 4 * 2, spacing);
        const std::string message = message_of<InvalidInput>([&] { read_volume(folder / "spacing.nii"); });
        expect_good_message(message, folder / "spacing.nii");
        EXPECT_THAT(message, HasSubstr("spacing along axis 1"));
    }
}

TEST(BadFiles, ZeroSpacingIsRefusedInNrrdAndMetaImage) {
    const TemporaryFolder folder;
    const std::string data(64, 'a');
    write_text(folder / "zero.nrrd", nrrd("4 4 4", "(1,0,0) (0,1,0) (0,0,0)", data));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "zero.nrrd"); }),
                HasSubstr("spacing along axis 2"));
    write_text(folder / "zero.mha", meta("4 4 4", "1 0 1", data));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "zero.mha"); }), HasSubstr("spacing along axis 1"));
    write_text(folder / "nan.mha", meta("4 4 4", "1 nan 1", data));
    EXPECT_THROW(read_volume(folder / "nan.mha"), InvalidInput);
    write_text(folder / "good.nrrd", nrrd("4 4 4", "(1,0,0) (0,1,0) (0,0,2)", data));
    write_text(folder / "good.mha", meta("4 4 4", "1 1 2", data));
    EXPECT_EQ(read_volume(folder / "good.nrrd").geometry.spacing[2], 2.0);
    EXPECT_EQ(read_volume(folder / "good.mha").geometry.spacing[2], 2.0);
}

TEST(BadFiles, SkewedAxesAreRefused) {
    const TemporaryFolder folder;
    write_text(folder / "skew.nrrd", nrrd("4 4 4", "(1,0,0) (0.3,1,0) (0,0,1)", std::string(64, 'a')));
    EXPECT_THROW(read_volume(folder / "skew.nrrd"), InvalidInput);
    write_volume(some_volume(), folder / "skew.nii");
    patch<short>(folder / "skew.nii", 252, 0);         // no qform to fall back on
    patch<float>(folder / "skew.nii", 280 + 4, 5.0F);  // sform, row x, column j
    const std::string message = message_of<Error>([&] { read_volume(folder / "skew.nii"); });
    expect_good_message(message, folder / "skew.nii");
}

TEST(BadFiles, VoxelsThatAreNotFiniteAreNamed) {
    const TemporaryFolder folder;
    for (const float value : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        Volume volume = some_volume();
        volume.data<float>()[volume.offset(3, 4, 5)] = value;
        write_volume(volume, folder / "nan.nii.gz");
        const std::string message = message_of<InvalidInput>([&] { read_volume(folder / "nan.nii.gz"); });
        expect_good_message(message, folder / "nan.nii.gz");
        EXPECT_THAT(message, HasSubstr("voxel (3, 4, 5)"));
    }
}

TEST(BadFiles, HugeSizesAreRefusedBeforeAllocation) {
    const TemporaryFolder folder;
    write_volume(some_volume(), folder / "huge.nii");
    for (int axis = 0; axis < 3; ++axis) patch<short>(folder / "huge.nii", 42 + 2 * axis, 32767);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "huge.nii"); }), HasSubstr("limit 2147483647"));
    write_text(folder / "huge.nrrd", nrrd("4294967296 4294967296 4294967296", "(1,0,0) (0,1,0) (0,0,1)", "abc"));
    EXPECT_THROW(read_volume(folder / "huge.nrrd"), InvalidInput);
    write_text(folder / "huge.mha", meta("65536 65536 65536", "1 1 1", "abc"));
    EXPECT_THROW(read_volume(folder / "huge.mha"), InvalidInput);
    write_text(folder / "negative.mha", meta("4 -4 4", "1 1 1", "abc"));
    EXPECT_THROW(read_volume(folder / "negative.mha"), InvalidInput);
}

TEST(BadFiles, ASmallFileThatPromisesGigabytesIsCutShort) {
    const TemporaryFolder folder;
    write_volume(test::random_volume(test::plain_grid({8, 8, 8}), CV_8U), folder / "promise.nii");
    for (int axis = 0; axis < 3; ++axis) patch<short>(folder / "promise.nii", 42 + 2 * axis, 1200);
    EXPECT_THROW(read_volume(folder / "promise.nii"), IoError);
    write_text(folder / "promise.nrrd", nrrd("1200 1200 1200", "(1,0,0) (0,1,0) (0,0,1)", "abc"));
    EXPECT_THROW(read_volume(folder / "promise.nrrd"), IoError);
}

TEST(BadFiles, DisagreeingFormsAreNoted) {
    const TemporaryFolder folder;
    write_volume(some_volume(), folder / "forms.nii");
    EXPECT_TRUE(read_volume_with_notes(folder / "forms.nii").notes.empty());
    patch<float>(folder / "forms.nii", 280 + 12, 77.0F);  // the sform's x offset
    const auto notes = read_volume_with_notes(folder / "forms.nii").notes;
    ASSERT_EQ(notes.size(), 1U);
    EXPECT_THAT(notes[0], HasSubstr("sform and qform disagree"));
}

TEST(BadFiles, AHeaderWithoutFormsIsNoted) {
    const TemporaryFolder folder;
    write_volume(some_volume(), folder / "none.nii");
    patch<short>(folder / "none.nii", 252, 0);
    patch<short>(folder / "none.nii", 254, 0);
    EXPECT_THAT(read_volume_with_notes(folder / "none.nii").notes,
                testing::ElementsAre(HasSubstr("neither qform nor sform")));
}

}  // namespace
}  // namespace tissuewarp::imaging
