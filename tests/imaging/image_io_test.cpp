#include "imaging/image_io.hpp"
#include "core/errors.hpp"
#include "imaging/sampling.hpp"
#include "test_volumes.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>
#include <zlib.h>

#include <sys/resource.h>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>

namespace tissuewarp::imaging {
namespace {

using test::oblique_grid;
using test::TemporaryFolder;

const std::filesystem::path sample = tissuewarp::test::source_folder() / "data" / "brainshift";

class EveryFormat : public testing::TestWithParam<const char*> {};

void expect_round_trip(const Volume& written, const std::filesystem::path& path) {
    write_volume(written, path);
    const Volume read = read_volume(path);
    EXPECT_TRUE(test::same_voxels(read.voxels, written.voxels));
    // NIfTI stores float32: 1e-6 of a voxel at the corners of these grids, relative to 100 mm.
    EXPECT_LT((read.geometry.origin - written.geometry.origin).norm(), 1e-6 * 200);
    EXPECT_LT((read.geometry.spacing - written.geometry.spacing).norm(), 1e-6);
    EXPECT_LT((read.geometry.direction - written.geometry.direction).norm(), 2e-6);
}

TEST_P(EveryFormat, KeepsEveryVoxelTypeAndTheGeometry) {
    const TemporaryFolder folder;
    for (const int depth : {CV_8U, CV_8S, CV_16U, CV_16S, CV_32S, CV_32F, CV_64F}) {
        SCOPED_TRACE(depth);
        expect_round_trip(test::random_volume(oblique_grid(), depth), folder / (std::string("volume") + GetParam()));
    }
}

TEST_P(EveryFormat, KeepsLeftHandedAxes) {
    const TemporaryFolder folder;
    expect_round_trip(test::random_volume(oblique_grid({7, 9, 11}, true), CV_16S),
                      folder / (std::string("left") + GetParam()));
}

TEST_P(EveryFormat, KeepsVectorsOfThreeComponents) {
    const TemporaryFolder folder;
    expect_round_trip(test::random_volume(oblique_grid(), CV_32FC3), folder / (std::string("field") + GetParam()));
    expect_round_trip(test::random_volume(oblique_grid(), CV_64FC3), folder / (std::string("field") + GetParam()));
}

TEST_P(EveryFormat, NamesMayBeInCapitals) {
    const TemporaryFolder folder;
    std::string name = std::string("volume") + GetParam();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::toupper(c); });
    expect_round_trip(test::random_volume(oblique_grid(), CV_16S), folder / name);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST_P(EveryFormat, LeavesNothingButTheFile) {
    const TemporaryFolder folder;
    const auto path = folder / (std::string("only") + GetParam());
    write_volume(test::random_volume(oblique_grid(), CV_16S), path);
    int files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++files;
    EXPECT_EQ(files, 1);
}

TEST_P(EveryFormat, AFullDiskIsReportedAndLeavesNothing) {
    const TemporaryFolder folder;
    Volume noise(test::plain_grid({64, 64, 64}), CV_32F);  // 1 MB that does not compress
    cv::RNG(7).fill(noise.voxels, cv::RNG::UNIFORM, 0.0F, 1.0F);
    // A limit on file size makes writes fail where a full disk would, on any machine and without rights.
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{100'000, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const auto path = folder / (std::string("full") + GetParam());
    const std::string message = test::message_of<IoError>([&] { write_volume(noise, path); });
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
    std::signal(SIGXFSZ, handler);
    EXPECT_THAT(message, testing::HasSubstr("cannot write"));
    EXPECT_TRUE(folder.is_empty());
}

INSTANTIATE_TEST_SUITE_P(ImageIo, EveryFormat, testing::Values(".nii", ".nii.gz", ".nrrd", ".mha"),
                         [](const auto& tested) {
                             std::string name = tested.param + 1;
                             std::replace(name.begin(), name.end(), '.', '_');
                             return name;
                         });

TEST(ImageIo, DisplacementFieldsCarryIntent1007AndFiveDimensions) {
    const TemporaryFolder folder;
    write_volume(Volume(oblique_grid(), CV_32FC3), folder / "field.nii");
    std::ifstream file(folder / "field.nii", std::ios::binary);
    std::array<short, 174> header{};
    file.read(reinterpret_cast<char*>(header.data()), 348);
    EXPECT_EQ(std::vector<short>(header.begin() + 20, header.begin() + 26), (std::vector<short>{5, 7, 9, 11, 1, 3}));
    EXPECT_EQ(header[34], 1007);
}

TEST(ImageIo, NrrdFieldsSayVector) {
    const TemporaryFolder folder;
    write_volume(Volume(oblique_grid(), CV_32FC3), folder / "field.nrrd");
    std::ifstream file(folder / "field.nrrd", std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    EXPECT_THAT(text.str(), testing::ContainsRegex("kinds: vector domain domain domain"));
    EXPECT_THAT(text.str(), testing::ContainsRegex("space: left-posterior-superior"));
}

TEST(ImageIo, VectorsOfIntent1006AreTurnedFromRasToLps) {
    const TemporaryFolder folder;
    Volume field(test::plain_grid({3, 3, 3}), CV_32FC3);
    field.voxels.setTo(cv::Scalar(1, 2, 3));
    write_volume(field, folder / "field.nii");
    {
        std::fstream file(folder / "field.nii", std::ios::binary | std::ios::in | std::ios::out);
        const short intent = 1006;
        file.seekp(68);
        file.write(reinterpret_cast<const char*>(&intent), 2);
    }
    const ReadResult result = read_volume_with_notes(folder / "field.nii");
    EXPECT_EQ(result.volume.voxels.at<cv::Vec3f>(1, 1, 1), cv::Vec3f(-1, -2, 3));
    ASSERT_EQ(result.notes.size(), 1U);
    EXPECT_THAT(result.notes[0], testing::HasSubstr("1006"));
}

TEST(ImageIo, ThePhantomsTruthCarriesItsLandmarks) {
    const Volume field = read_volume(sample / "truth_forward.nii.gz");
    std::array<Volume, 3> components;
    for (int c = 0; c < 3; ++c) {
        components[static_cast<std::size_t>(c)] = Volume(field.geometry, CV_32F);
        const auto count = static_cast<std::size_t>(field.geometry.voxel_count());
        for (std::size_t i = 0; i < count; ++i)
            components[static_cast<std::size_t>(c)].data<float>()[i] =
                field.voxels.ptr<float>()[3 * i + static_cast<std::size_t>(c)];
    }
    const LinearSampler x(components[0]), y(components[1]), z(components[2]);
    std::ifstream file(sample / "landmarks.csv");
    std::string line;
    std::getline(file, line);
    double sum = 0.0;
    int count = 0;
    while (std::getline(file, line)) {
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream numbers(line);
        Eigen::Vector3d before, after;
        numbers >> before[0] >> before[1] >> before[2] >> after[0] >> after[1] >> after[2];
        sum += (before + Eigen::Vector3d(x.value(before), y.value(before), z.value(before)) - after).norm();
        ++count;
    }
    ASSERT_EQ(count, 220);
    // nibabel and scipy give 0.0044 mm; components read as RAS would give 2.11 mm, no displacement 1.51 mm.
    EXPECT_LT(sum / count, 0.005);
}

TEST(ImageIo, TheSampleHeadHasItsLabelsOnItsGrid) {
    const Volume image = read_volume(sample / "preop.nii.gz");
    const Volume labels = read_labels(sample / "preop_labels.nii.gz");
    EXPECT_EQ(image.geometry.size, (std::array<int, 3>{175, 212, 170}));
    EXPECT_EQ(image.voxels.type(), CV_16SC1);
    EXPECT_EQ(labels.voxels.type(), CV_32SC1);
    EXPECT_TRUE(same_grid(image.geometry, labels.geometry));
}

TEST(ImageIo, WholeFloatLabelsAreAcceptedAndFractionsRefused) {
    const TemporaryFolder folder;
    Volume labels(test::plain_grid({3, 3, 3}), CV_32F);
    labels.data<float>()[4] = 70000.0F;
    write_volume(labels, folder / "labels.nrrd");
    EXPECT_EQ(read_labels(folder / "labels.nrrd").data<int>()[4], 70000);
    labels.data<float>()[4] = 1.5F;
    write_volume(labels, folder / "labels.nrrd");
    EXPECT_THAT(test::message_of<InvalidInput>([&] { read_labels(folder / "labels.nrrd"); }),
                testing::HasSubstr("1.5"));
    labels.data<float>()[4] = 1.0000001F;
    write_volume(labels, folder / "labels.nrrd");
    EXPECT_THAT(test::message_of<InvalidInput>([&] { read_labels(folder / "labels.nrrd"); }),
                testing::HasSubstr("the value 1.0000001"));
    labels.data<float>()[4] = -1.0F;
    write_volume(labels, folder / "labels.nrrd");
    EXPECT_THROW(read_labels(folder / "labels.nrrd"), InvalidInput);
}

TEST(ImageIo, WideIntegersBecomeInt32WhenTheyFitAndFloat64Otherwise) {
    const TemporaryFolder folder;
    const auto write_nrrd = [&](const char* name, std::array<std::uint32_t, 8> values) {
        std::ofstream file(folder / name, std::ios::binary);
        file << "NRRD0004\ntype: uint32\ndimension: 3\nspace: left-posterior-superior\nsizes: 2 2 2\n"
             << "space directions: (1,0,0) (0,1,0) (0,0,1)\nkinds: domain domain domain\nendian: little\n"
             << "encoding: raw\nspace origin: (0,0,0)\n\n";
        file.write(reinterpret_cast<const char*>(values.data()), sizeof(values));
    };
    write_nrrd("narrow.nrrd", {1, 2, 3, 4, 5, 6, 7, 2147483647U});
    write_nrrd("wide.nrrd", {1, 2, 3, 4, 5, 6, 7, 4294967295U});
    const Volume narrow = read_volume(folder / "narrow.nrrd"), wide = read_volume(folder / "wide.nrrd");
    ASSERT_EQ(narrow.voxels.type(), CV_32SC1);
    EXPECT_EQ(narrow.data<int>()[7], 2147483647);
    ASSERT_EQ(wide.voxels.type(), CV_64FC1);
    EXPECT_EQ(wide.data<double>()[7], 4294967295.0);
}

TEST(ImageIo, ANrrdInRasSpaceLandsInLps) {
    const TemporaryFolder folder;
    std::ofstream file(folder / "ras.nrrd", std::ios::binary);
    file << "NRRD0004\ntype: uint8\ndimension: 3\nspace: right-anterior-superior\nsizes: 2 2 2\n"
         << "space directions: (2,0,0) (0,3,0) (0,0,4)\nkinds: domain domain domain\n"
         << "encoding: raw\nspace origin: (10,20,30)\n\n12345678";
    file.close();
    const Geometry grid = read_volume(folder / "ras.nrrd").geometry;
    EXPECT_TRUE(grid.point({1, 1, 1}).isApprox(Eigen::Vector3d(-12, -23, 34), 1e-12));
}

std::string bytes_of(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

TEST(ImageIo, WritingTwiceGivesTheSameBytes) {
    const TemporaryFolder folder;
    const Volume volume = test::random_volume(test::plain_grid({100, 100, 100}), CV_16S);
    std::array<std::string, 2> bytes;
    for (std::size_t i = 0; i < 2; ++i) {
        write_volume(volume, folder / "twice.nii.gz");
        bytes[i] = bytes_of(folder / "twice.nii.gz");
    }
    EXPECT_EQ(bytes[0], bytes[1]);
}

/// Of one gzip member, which must be all there is.
std::string unpacked(std::string packed, std::size_t size) {
    std::string plain(size + 1, '\0');
    z_stream stream{};
    EXPECT_EQ(inflateInit2(&stream, MAX_WBITS + 16), Z_OK);
    stream.next_in = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_in = static_cast<uInt>(packed.size());
    stream.next_out = reinterpret_cast<Bytef*>(plain.data());
    stream.avail_out = static_cast<uInt>(plain.size());
    EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
    EXPECT_EQ(stream.avail_in, 0U);
    plain.resize(stream.total_out);
    inflateEnd(&stream);
    return plain;
}

// Compressed files are made in pieces, plain ones by ITK.
TEST(ImageIo, CompressedNiftiUnpacksToThePlainFile) {
    const TemporaryFolder folder;
    for (const int type : {CV_8U, CV_8S, CV_16U, CV_16S, CV_32S, CV_32F, CV_64F, CV_32FC3, CV_64FC3}) {
        SCOPED_TRACE(type);
        Volume volume = test::random_volume(oblique_grid({61, 73, 87}, true), type);  // up to nine blocks of 1 MiB
        volume.voxels.row(5).setTo(0);                                                // and what packs well
        volume.voxels.rowRange(20, 40).setTo(1);
        write_volume(volume, folder / "plain.nii");
        write_volume(volume, folder / "packed.nii.gz");
        const std::string plain = bytes_of(folder / "plain.nii");
        EXPECT_TRUE(unpacked(bytes_of(folder / "packed.nii.gz"), plain.size()) == plain);
    }
}

TEST(ImageIo, MoreVoxelsThanNiftiCountsAreRefused) {
    const TemporaryFolder folder;
    const Volume needle(test::plain_grid({40'000, 2, 2}), CV_8U);
    const std::string message = test::message_of<IoError>([&] { write_volume(needle, folder / "needle.nii.gz"); });
    EXPECT_THAT(message, testing::AllOf(testing::HasSubstr("40000"), testing::HasSubstr(".nrrd")));
    EXPECT_TRUE(folder.is_empty());
}

TEST(ImageIo, CompressedNiftiIsOneGzipMember) {
    // Readers in browsers stop after the first member of a gzip file.
    const TemporaryFolder folder;
    const Volume volume = test::random_volume(test::plain_grid({200, 200, 100}), CV_8U);  // 4 blocks of 1 MiB
    write_volume(volume, folder / "one.nii.gz");
    EXPECT_EQ(unpacked(bytes_of(folder / "one.nii.gz"), 5'000'000).size(), 352U + 4'000'000U);
}

TEST(ImageIo, WrittenDisplacementsAreWholeStepsLessThanAMicrometreAway) {
    const TemporaryFolder folder;
    Volume field(test::oblique_grid({20, 19, 18}), CV_32FC3);
    cv::RNG random(3);
    random.fill(test::flat(field.voxels), cv::RNG::UNIFORM, -40, 40);
    for (const char* name : {"field.nii.gz", "field.nrrd", "field.mha"}) {
        write_displacement_field(field, folder / name, FieldType::Resampling);
        const Volume read = read_volume(folder / name);
        EXPECT_LE(test::largest_difference(field.voxels, read.voxels), 0.5 * displacement_step_mm + 1e-9) << name;
        EXPECT_EQ(test::largest_difference(rounded(field, displacement_step_mm).voxels, read.voxels), 0) << name;
    }
    write_volume(field, folder / "exact.nii.gz");
    // Noise, the hardest to pack.
    EXPECT_LT(std::filesystem::file_size(folder / "field.nii.gz"),
              0.85 * std::filesystem::file_size(folder / "exact.nii.gz"));
}

TEST(ImageIo, NrrdSaysWhichPointsAFieldCarries) {
    const TemporaryFolder folder;
    const Volume field(test::plain_grid({4, 4, 4}), CV_32FC3);
    for (const FieldType type : {FieldType::Modeling, FieldType::Resampling}) {
        write_displacement_field(field, folder / "field.nrrd", type);
        EXPECT_EQ(stated_field_type(folder / "field.nrrd"), type);
        std::ifstream file(folder / "field.nrrd", std::ios::binary);
        std::stringstream text;
        text << file.rdbuf();
        EXPECT_THAT(text.str(), testing::HasSubstr(std::string("displacement field type:=") + name_of(type) + "\n"));
    }
    write_displacement_field(field, folder / "field.nii.gz", FieldType::Modeling);
    EXPECT_EQ(stated_field_type(folder / "field.nii.gz"), std::nullopt);
    write_volume(field, folder / "silent.nrrd");
    EXPECT_EQ(stated_field_type(folder / "silent.nrrd"), std::nullopt);
    EXPECT_THROW(write_displacement_field(field.as(CV_64F), folder / "wide.nrrd", FieldType::Modeling), InvalidInput);
}

TEST(ImageIo, UnknownExtensionsAndMissingFoldersAreRefused) {
    const TemporaryFolder folder;
    const Volume volume(test::plain_grid({2, 2, 2}), CV_8U);
    for (const char* name : {"volume.png", "volume.hdr", "volume.img", "volume.mhd", "volume.nhdr"})
        EXPECT_THROW(write_volume(volume, folder / name), InvalidInput);
    EXPECT_THROW(write_volume(volume, folder / "missing/volume.nii.gz"), IoError);
    EXPECT_THROW(write_volume(volume, folder / "missing/volume.nrrd"), IoError);
    EXPECT_THROW(write_volume(volume, folder / "missing/volume.mha"), IoError);
}

}  // namespace
}  // namespace tissuewarp::imaging
