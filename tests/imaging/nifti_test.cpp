/// NIfTI headers that other readers answer differently: units, both forms, packed files by any name, pairs, NIfTI-2.

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
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

std::string bytes_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

void write(const fs::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

template <class T>
void put(std::string& bytes, std::size_t offset, T value) {
    bytes.replace(offset, sizeof(T), reinterpret_cast<const char*>(&value), sizeof(T));
}

/// 4 x 5 x 6 voxels of 2 mm, both forms set.
Volume some_volume() {
    Geometry grid = test::plain_grid({4, 5, 6}, {2, 2, 2});
    grid.origin = {10, 20, 30};
    return test::random_volume(grid, CV_16S);
}

std::string nifti_bytes(const TemporaryFolder& folder) {
    write_volume(some_volume(), folder / "plain.nii");
    return bytes_of(folder / "plain.nii");
}

constexpr std::size_t dim_field = 40, intent_code = 68, datatype = 70, pixdim = 76, units = 123, qform_code = 252,
                      sform_code = 254, qoffset = 268, srow = 280;

/// Lengths of the header times a factor.
std::string scaled(std::string bytes, float factor, char unit) {
    const auto scale = [&](std::size_t offset) {
        float value = 0;
        std::memcpy(&value, bytes.data() + offset, 4);
        put(bytes, offset, factor * value);
    };
    for (std::size_t i = 1; i < 4; ++i) scale(pixdim + 4 * i);
    for (std::size_t i = 0; i < 3; ++i) scale(qoffset + 4 * i);
    for (std::size_t i = 0; i < 12; ++i) scale(srow + 4 * i);
    bytes[units] = unit;
    return bytes;
}

TEST(Nifti, UnitsScaleSpacingAndOriginInBothForms) {
    const TemporaryFolder folder;
    const std::string plain = nifti_bytes(folder);
    for (const auto& [factor, unit] : {std::pair{1000.0F, 3}, {0.001F, 1}})
        for (const short both : {short{0}, short{1}}) {
            std::string bytes = scaled(plain, factor, static_cast<char>(unit));
            put<short>(bytes, qform_code, both);
            put<short>(bytes, sform_code, static_cast<short>(1 - both));
            write(folder / "a.nii", bytes);
            const ReadResult read = read_volume_with_notes(folder / "a.nii");
            EXPECT_LT(grid_distance(read.volume.geometry, some_volume().geometry), 1e-4);
            EXPECT_THAT(read.notes, ElementsAre(HasSubstr("converted to mm")));
        }
    std::string unknown = plain;
    unknown[units] = 5;
    write(folder / "a.nii", unknown);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.nii"); }), HasSubstr("code 5"));
}

TEST(Nifti, FormsAreChosenAsItkDoesWithANote) {
    const TemporaryFolder folder;
    const std::string plain = nifti_bytes(folder);
    const auto origin = [&](short qform, short sform) {
        std::string bytes = plain;
        put<short>(bytes, qform_code, qform);
        put<short>(bytes, sform_code, sform);
        put(bytes, srow + 12, 30.0F);  // RAS x of the sform; the qform says -10
        write(folder / "a.nii", bytes);
        const ReadResult read = read_labels_with_notes(folder / "a.nii");
        EXPECT_EQ(read.notes.size(), qform > 0 && sform > 0 ? 1U : 0U);
        return read.volume.geometry.origin[0];
    };
    for (const short qform : {short{1}, short{2}, short{4}}) {
        EXPECT_NEAR(origin(qform, 1), -30, 1e-5);
        EXPECT_NEAR(origin(qform, 2), 10, 1e-5);
        EXPECT_NEAR(origin(qform, 4), 10, 1e-5);
        EXPECT_NEAR(origin(qform, 0), 10, 1e-5);
    }
    EXPECT_NEAR(origin(0, 2), -30, 1e-5);
}

TEST(Nifti, AnSformOfOtherVoxelsThanPixdimIsRefusedWithBothNumbers) {
    const TemporaryFolder folder;
    std::string bytes = nifti_bytes(folder);
    put<short>(bytes, qform_code, 0);
    for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 3; ++column)
            put(bytes, srow + 16 * row + 4 * column, row == column ? 1.0F : 0.0F);
    write(folder / "a.nii", bytes);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.nii"); }),
                testing::AllOf(HasSubstr("sform states voxels of 1 x 1 x 1"), HasSubstr("pixdim of 2 x 2 x 2")));
    put<short>(bytes, qform_code, 1);  // which decides, with a note
    write(folder / "a.nii", bytes);
    const ReadResult read = read_volume_with_notes(folder / "a.nii");
    EXPECT_TRUE(read.volume.geometry.spacing.isApprox(Eigen::Vector3d(2, 2, 2)));
    EXPECT_THAT(read.notes, ElementsAre(HasSubstr("disagree")));
}

TEST(Nifti, PackedFilesAreKnownByTheirFirstBytesAndNamesInAnyCase) {
    const TemporaryFolder folder;
    const std::string plain = nifti_bytes(folder);
    write_volume(some_volume(), folder / "packed.nii.gz");
    const std::string packed = bytes_of(folder / "packed.nii.gz");
    for (const auto& [name, bytes] : {std::pair{"UPPER.NII.GZ", packed},
                                      {"Mixed.Nii", plain},
                                      {"gz_named.nii", packed},
                                      {"plain_named.nii.gz", plain}}) {
        SCOPED_TRACE(name);
        write(folder / name, bytes);
        EXPECT_TRUE(is_image(folder / name));
        EXPECT_TRUE(test::same_voxels(read_volume(folder / name).voxels, some_volume().voxels));
    }
    write(folder / "gz_named.nii", packed.substr(0, packed.size() - 9));
    EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "gz_named.nii"); }), HasSubstr("cut short"));
}

TEST(Nifti, APairOfHeaderAndVoxelsIsRead) {
    const TemporaryFolder folder;
    const std::string plain = nifti_bytes(folder);
    std::string header = plain.substr(0, 348);
    header.replace(344, 4, std::string("ni1\0", 4));
    put(header, 108, 0.0F);
    write(folder / "pair.hdr", header);
    EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "pair.hdr"); }), HasSubstr("pair.img"));
    write(folder / "pair.img", plain.substr(352));
    const Volume read = read_volume(folder / "pair.hdr");
    EXPECT_TRUE(test::same_voxels(read.voxels, some_volume().voxels));
    EXPECT_TRUE(same_grid(read.geometry, some_volume().geometry));
    EXPECT_TRUE(test::same_voxels(read_volume(folder / "pair.img").voxels, some_volume().voxels));
    header.replace(344, 4, std::string(4, '\0'));
    write(folder / "pair.hdr", header);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "pair.hdr"); }), HasSubstr("ANALYZE 7.5"));
}

TEST(Nifti, TheSecondVersionIsRead) {
    const TemporaryFolder folder;
    const std::string voxels = nifti_bytes(folder).substr(352);
    std::string header(544, '\0');
    put<std::int32_t>(header, 0, 540);
    header.replace(4, 8, std::string("n+2\0\r\n\032\n", 8));
    put<short>(header, 12, 4);
    put<short>(header, 14, 16);
    const std::array<std::int64_t, 8> dim{3, 4, 5, 6, 1, 1, 1, 1};
    for (std::size_t i = 0; i < 8; ++i) put(header, 16 + 8 * i, dim[i]);
    for (std::size_t i = 0; i < 4; ++i) put(header, 104 + 8 * i, i ? 2.0 : 1.0);
    put<std::int64_t>(header, 168, 544);
    put<std::int32_t>(header, 348, 1);
    const std::array<double, 12> rows{-2, 0, 0, -10, 0, -2, 0, -20, 0, 0, 2, 30};
    for (std::size_t i = 0; i < 12; ++i) put(header, 400 + 8 * i, rows[i]);
    put<std::int32_t>(header, 500, 2);
    write(folder / "two.nii", header + voxels);
    const ReadResult read = read_volume_with_notes(folder / "two.nii");
    EXPECT_TRUE(test::same_voxels(read.volume.voxels, some_volume().voxels));
    EXPECT_TRUE(same_grid(read.volume.geometry, some_volume().geometry));
    EXPECT_TRUE(read.notes.empty());
}

TEST(Nifti, BytesBehindTheVoxelsAreNoted) {
    const TemporaryFolder folder;
    write(folder / "long.nii", nifti_bytes(folder) + std::string(240, '\0'));
    EXPECT_THAT(read_volume_with_notes(folder / "long.nii").notes,
                ElementsAre(HasSubstr("240 bytes behind the voxels")));
}

TEST(Nifti, FieldsOfNiftyRegAreTurnedToDisplacementsInLps) {
    const TemporaryFolder folder;
    Geometry grid = test::plain_grid({3, 3, 3}, {2, 2, 2});
    grid.origin = {10, 20, 30};
    Volume field(grid, CV_32FC3);
    const auto read = [&](float kind) {
        write_volume(field, folder / "field.nii");
        std::string bytes = bytes_of(folder / "field.nii");
        bytes.replace(328, 16, std::string("NREG_TRANS") + std::string(6, '\0'));
        put(bytes, 56, kind);
        write(folder / "field.nii", bytes);
        return read_volume_with_notes(folder / "field.nii");
    };
    field.voxels.setTo(cv::Scalar(1, 2, 3));
    const ReadResult displacement = read(1.0F);
    EXPECT_EQ(displacement.volume.voxels.at<cv::Vec3f>(1, 1, 1), cv::Vec3f(-1, -2, 3));
    EXPECT_THAT(displacement.notes, ElementsAre(HasSubstr("NiftyReg")));
    for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 3; ++i) {
                const Eigen::Vector3d p = grid.point({1.0 * i, 1.0 * j, 1.0 * k}) + Eigen::Vector3d(0.5, 0.25, -1);
                field.voxels.at<cv::Vec3f>(k, j, i) = cv::Vec3f(cv::Vec3d(-p[0], -p[1], p[2]));
            }
    EXPECT_LT(cv::norm(read(0.0F).volume.voxels.at<cv::Vec3f>(2, 1, 0) - cv::Vec3f(0.5F, 0.25F, -1)), 1e-5);
    EXPECT_THAT(message_of<InvalidInput>([&] { read(5.0F); }), HasSubstr("NiftyReg"));
}

TEST(Nifti, WarpsOfFslAreRefused) {
    const TemporaryFolder folder;
    write_volume(Volume(test::plain_grid({3, 3, 3}, {2, 2, 2}), CV_32FC3), folder / "field.nii");
    std::string bytes = bytes_of(folder / "field.nii");
    for (const short dimensions : {short{5}, short{4}}) {
        put(bytes, intent_code, std::int16_t{2006});
        put(bytes, dim_field, dimensions);
        put<short>(bytes, dim_field + 8, dimensions == 4 ? 3 : 1);
        write(folder / "field.nii", bytes);
        EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "field.nii"); }),
                    HasSubstr("FSL (intent 2006)"));
    }
}

Volume some_field() {
    Volume field(test::plain_grid({3, 3, 3}, {2, 2, 2}), CV_32FC3);
    field.voxels.setTo(cv::Scalar(1, 2, 3));
    return field;
}

TEST(Nifti, VectorsAreInTheUnitOfTheHeader) {
    const TemporaryFolder folder;
    write_volume(some_field(), folder / "field.nii");
    for (const short intent : {short{1006}, short{1007}}) {
        std::string bytes = scaled(bytes_of(folder / "field.nii"), 0.001F, 1);
        put(bytes, intent_code, intent);
        write(folder / "metres.nii", bytes);
        const ReadResult read = read_volume_with_notes(folder / "metres.nii");
        const float sign = intent == 1006 ? -1 : 1;
        EXPECT_EQ(read.volume.voxels.at<cv::Vec3f>(1, 1, 1), cv::Vec3f(sign * 1000, sign * 2000, 3000));
        EXPECT_THAT(read.notes, testing::Contains(HasSubstr("its vectors are taken in the unit that the header")));
    }
}

TEST(Nifti, VectorsAlongTheFourthAxisAreKnownByTheirIntent) {
    const TemporaryFolder folder;
    write_volume(some_field(), folder / "field.nii");
    std::string bytes = bytes_of(folder / "field.nii");
    put<short>(bytes, dim_field, 4);
    put<short>(bytes, dim_field + 8, 3);
    write(folder / "field.nii", bytes);
    EXPECT_TRUE(test::same_voxels(read_volume(folder / "field.nii").voxels, some_field().voxels));
    put<short>(bytes, intent_code, 0);
    write(folder / "field.nii", bytes);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "field.nii"); }),
                HasSubstr("3 time points, or vectors without NIfTI's intent 1007"));
}

TEST(Nifti, AQformOfNegativeVoxelsIsRefused) {
    const TemporaryFolder folder;
    std::string bytes = nifti_bytes(folder);
    put(bytes, pixdim + 4, -2.0F);
    write(folder / "a.nii", bytes);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.nii"); }),
                HasSubstr("its pixdim states voxels of -2 x 2 x 2, and a qform needs positive ones"));
}

TEST(Nifti, TypesThatAreNoneAreNamed) {
    const TemporaryFolder folder;
    std::string bytes = nifti_bytes(folder);
    for (const auto& [type, text] : {std::pair{short{0}, "type 0 (unknown)"}, {short{1}, "type 1 (single bits)"}}) {
        put(bytes, datatype, type);
        write(folder / "a.nii", bytes);
        EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.nii"); }), HasSubstr(text));
    }
}

}  // namespace
}  // namespace tissuewarp::imaging
