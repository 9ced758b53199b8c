/// NRRD and MetaImage as other programs write them: lists of files, packed data, orders of axes, units. The test writes
/// the files itself, so that no library vouches for its own mistakes.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>
#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <sstream>

namespace tissuewarp::imaging {
namespace {

using test::message_of;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// Voxels of 3 x 4 x 5, each its own number.
std::string counted_bytes(int count = 60) {
    std::string bytes(static_cast<std::size_t>(count), '\0');
    std::iota(bytes.begin(), bytes.end(), '\1');
    return bytes;
}

std::string packed(const std::string& plain, int window = MAX_WBITS) {
    std::string result(compressBound(plain.size()) + 64, '\0');
    z_stream stream{};
    deflateInit2(&stream, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(plain.data()));
    stream.avail_in = static_cast<uInt>(plain.size());
    stream.next_out = reinterpret_cast<Bytef*>(result.data());
    stream.avail_out = static_cast<uInt>(result.size());
    deflate(&stream, Z_FINISH);
    result.resize(stream.total_out);
    deflateEnd(&stream);
    return result;
}

void write(const fs::path& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
}

void expect_counted(const Volume& volume) {
    ASSERT_EQ(volume.geometry.size, (std::array<int, 3>{3, 4, 5}));
    const Volume values = volume.as(CV_32S);
    for (int i = 0; i < 60; ++i) ASSERT_EQ(values.data<int>()[i], i + 1) << "voxel " << i;
}

/// A MetaImage header of 3 x 4 x 5 voxels up to the line of the data file.
std::string meta(const std::string& more = "", const std::string& type = "MET_UCHAR") {
    return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n" + more +
           "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 10 20 30\nElementSpacing = 2 3 4\nDimSize = 3 4 5\n" +
           "ElementType = " + type + "\nElementDataFile = ";
}

TEST(MetaImage, PackedVoxelsNeedNoStatedLength) {
    const TemporaryFolder folder;
    for (const char* size : {"", "CompressedDataSize = 7\n", "CompressedDataSize = 100000\n"}) {
        write(folder / "a.mha",
              meta(std::string("CompressedData = True\n") + size) + "LOCAL\n" + packed(counted_bytes()));
        expect_counted(read_volume(folder / "a.mha"));
    }
    write(folder / "a.mhd", meta("CompressedData = True\n") + "a.zraw\n");
    write(folder / "a.zraw", packed(counted_bytes()));
    expect_counted(read_volume(folder / "a.mhd"));
}

TEST(MetaImage, AxesAreRowsOfTheMatrix) {
    const TemporaryFolder folder;
    write(folder / "a.mha", meta() + "LOCAL\n" + counted_bytes());
    const Geometry grid = read_volume(folder / "a.mha").geometry;
    EXPECT_TRUE(grid.point({1, 0, 0}).isApprox(Eigen::Vector3d(10, 22, 30)));
    EXPECT_TRUE(grid.point({0, 1, 0}).isApprox(Eigen::Vector3d(7, 20, 30)));
}

TEST(MetaImage, PackedVoxelsThatAreCutShortOrTooManyAreRefused) {
    const TemporaryFolder folder;
    const std::string header = meta("CompressedData = True\n") + "LOCAL\n";
    for (const std::string& data : {packed(counted_bytes(59)), packed(counted_bytes(61)),
                                    packed(counted_bytes()).substr(0, 9), std::string("no zlib at all")}) {
        write(folder / "a.mha", header + data);
        EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "a.mha"); }), HasSubstr("a.mha"));
    }
}

/// Five files of a slice each.
void write_slices(const fs::path& folder, const std::string& before = "", const std::string& after = "") {
    for (int k = 0; k < 5; ++k)
        write(folder / (std::string("s") + std::to_string(k + 1) + ".raw"),
              before + counted_bytes().substr(12 * static_cast<std::size_t>(k), 12) + after);
}

TEST(MetaImage, ListsAndPatternsOfSlicesAreRead) {
    const TemporaryFolder folder;
    write_slices(folder.path());
    for (const char* data :
         {"LIST\ns1.raw\ns2.raw\ns3.raw\ns4.raw\ns5.raw\n", "LIST 2D\ns1.raw\ns2.raw\ns3.raw\ns4.raw\ns5.raw",
          "s%d.raw 1 5 1\n", "s%d.raw\n", "s%01d.raw 1\n"}) {
        SCOPED_TRACE(data);
        write(folder / "a.mhd", meta() + data);
        expect_counted(read_volume(folder / "a.mhd"));
    }
}

TEST(MetaImage, ListsThatDoNotFitAreRefused) {
    const TemporaryFolder folder;
    write_slices(folder.path());
    const auto refusal = [&](const std::string& data) {
        write(folder / "a.mhd", meta() + data);
        return message_of<Error>([&] { read_volume(folder / "a.mhd"); });
    };
    EXPECT_THAT(refusal("LIST\ns1.raw\ns2.raw\ns3.raw\n"), HasSubstr("3 files for 5 slices"));
    EXPECT_THAT(refusal("LIST\n"), HasSubstr("0 files for 5 slices"));
    EXPECT_THAT(refusal("LIST\ns1.raw\ns2.raw\ns3.raw\ns4.raw\nmissing.raw\n"), HasSubstr("missing.raw"));
    EXPECT_THAT(refusal("s%d.raw 2 6 1\n"), HasSubstr("s6.raw"));
    EXPECT_THAT(refusal("s%d.raw 1 3 1\n"), HasSubstr("3 files for 5 slices"));
    EXPECT_THAT(refusal("s%s.raw 1 5 1\n"), HasSubstr("no pattern"));
    for (const char* range : {"9223372036854775807", "99999999999999999999", "-9223372036854775808 1",
                              "1 9223372036854775807", "2147483648 2147483652", "1 5 9223372036854775807"})
        EXPECT_THAT(refusal("s%d.raw " + std::string(range) + "\n"), HasSubstr("count from")) << range;
    write(folder / "s4.raw", "half");
    EXPECT_THAT(refusal("s%d.raw 1 5 1\n"), testing::AllOf(HasSubstr("s4.raw"), HasSubstr("cut short")));
    write(folder / "s4.raw", std::string(40, 'x'));
    EXPECT_THAT(refusal("s%d.raw 1 5 1\n"), testing::AllOf(HasSubstr("s4.raw"), HasSubstr("does not fit")));
}

TEST(MetaImage, HeadersOfTheDataFilesAreSkippedAsStated) {
    const TemporaryFolder folder;
    write_slices(folder.path(), "header");
    for (const char* size : {"HeaderSize = 6\n", "HeaderSize = -1\n"}) {
        write(folder / "a.mhd", meta(size) + "s%d.raw 1 5 1\n");
        expect_counted(read_volume(folder / "a.mhd"));
    }
    write(folder / "a.raw", "some header" + counted_bytes());
    write(folder / "a.mhd", meta("HeaderSize = -1\n") + "a.raw\n");
    expect_counted(read_volume(folder / "a.mhd"));
    write(folder / "a.mhd", meta() + "a.raw\n");
    EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "a.mhd"); }), HasSubstr("does not fit"));
    write(folder / "a.mhd", meta("HeaderSize = 40\n") + "a.raw\n");
    EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "a.mhd"); }), HasSubstr("cut short"));
    write(folder / "a.raw", "short");
    write(folder / "a.mhd", meta("HeaderSize = -1\n") + "a.raw\n");
    EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "a.mhd"); }), HasSubstr("cut short"));
}

TEST(MetaImage, TextAndBigEndianVoxelsAreRead) {
    const TemporaryFolder folder;
    std::string text, big;
    for (int i = 1; i <= 60; ++i) {
        text += std::to_string(i) + (i % 7 ? " " : "\n");
        big += std::string{'\0', static_cast<char>(i)};
    }
    const std::string ascii =
        "ObjectType = Image\nNDims = 3\nBinaryData = False\nElementSpacing = 1 1 1\n"
        "DimSize = 3 4 5\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    write(folder / "text.mha", ascii + text);
    expect_counted(read_volume(folder / "text.mha"));
    write(folder / "text.mha", ascii + text.substr(0, text.size() - 4));
    EXPECT_THROW(read_volume(folder / "text.mha"), IoError);
    std::string header = meta("", "MET_SHORT") + "LOCAL\n";
    header.replace(header.find("MSB = False"), 11, "MSB = True");
    write(folder / "big.mha", header + big);
    expect_counted(read_volume(folder / "big.mha"));
}

TEST(MetaImage, VoxelsOfTwoValuesAndColoursAreRefused) {
    const TemporaryFolder folder;
    for (const int channels : {2, 3, 4}) {
        write(folder / "a.mha", meta(std::string("ElementNumberOfChannels = ") + std::to_string(channels) + "\n") +
                                    "LOCAL\n" + std::string(static_cast<std::size_t>(60 * channels), 'a'));
        EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.mha"); }),
                    HasSubstr(std::string("hold ") + std::to_string(channels)));
    }
}

TEST(MetaImage, UnitsAreConvertedAndUnknownOnesRefused) {
    const TemporaryFolder folder;
    write(folder / "a.mha", meta("DistanceUnits = cm\n") + "LOCAL\n" + counted_bytes());
    const ReadResult read = read_volume_with_notes(folder / "a.mha");
    EXPECT_TRUE(read.volume.geometry.spacing.isApprox(Eigen::Vector3d(20, 30, 40)));
    EXPECT_TRUE(read.volume.geometry.origin.isApprox(Eigen::Vector3d(100, 200, 300)));
    EXPECT_THAT(read.notes, ElementsAre(HasSubstr("given in cm")));
    for (const char* unit : {"mm", "?"}) {
        write(folder / "a.mha", meta(std::string("DistanceUnits = ") + unit + "\n") + "LOCAL\n" + counted_bytes());
        EXPECT_TRUE(read_volume_with_notes(folder / "a.mha").notes.empty());
    }
    write(folder / "a.mha", meta("DistanceUnits = furlong\n") + "LOCAL\n" + counted_bytes());
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.mha"); }), HasSubstr("'furlong'"));
}

std::string without_line(std::string text, const std::string& key) {
    const std::size_t at = text.find(key);
    return text.erase(at, text.find('\n', at) + 1 - at);
}

TEST(MetaImage, WhatTheHeaderDoesNotStateIsNoted) {
    const TemporaryFolder folder;
    for (const std::string key : {"Offset", "TransformMatrix", "ElementSpacing"}) {
        write(folder / "a.mha", without_line(meta(), key) + "LOCAL\n" + counted_bytes());
        EXPECT_THAT(read_volume_with_notes(folder / "a.mha").notes,
                    ElementsAre(HasSubstr("the header states no " + key)));
    }
}

TEST(MetaImage, VectorsAreInTheUnitOfTheHeader) {
    const TemporaryFolder folder;
    std::string data;
    for (int i = 0; i < 60; ++i) data += std::string("\1\0\2\0\3\0", 6);
    write(folder / "a.mha", meta("DistanceUnits = cm\nElementNumberOfChannels = 3\n", "MET_SHORT") + "LOCAL\n" + data);
    const ReadResult read = read_volume_with_notes(folder / "a.mha");
    EXPECT_EQ(read.volume.voxels.at<cv::Vec3f>(1, 1, 1), cv::Vec3f(10, 20, 30));
    EXPECT_THAT(read.notes, ElementsAre(HasSubstr("given in cm"), HasSubstr("its vectors are taken in the unit")));
}

TEST(MetaImage, HeadersThatStateAKeyTwiceAreRefusedWhereTheyDiffer) {
    const TemporaryFolder folder;
    const auto with = [&](const std::string& more) {
        write(folder / "a.mha", meta(more) + "LOCAL\n" + counted_bytes());
        return folder / "a.mha";
    };
    EXPECT_THAT(message_of<IoError>([&] { read_volume(with("ElementSpacing = 1 1 1\n")); }),
                HasSubstr("states 'elementspacing' twice, '1 1 1' and '2 3 4'"));
    expect_counted(read_volume(with("ElementSpacing = 2 3 4\nComment = a\nComment = b\n")));
}

TEST(MetaImage, FieldsBehindTheLastOneAreRefused) {
    const TemporaryFolder folder;
    write(folder / "a.raw", counted_bytes());
    write(folder / "a.mhd", meta() + "a.raw\n\n");
    expect_counted(read_volume(folder / "a.mhd"));
    write(folder / "a.mhd", meta() + "a.raw\nOffset = 1 2 3\n");
    EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "a.mhd"); }),
                HasSubstr("goes on after 'ElementDataFile', which ends it, with 'Offset = 1 2 3'"));
}

TEST(MetaImage, PackedVoxelsThatTheHeaderDoesNotSayAreNamed) {
    const TemporaryFolder folder;
    const std::string zeros(60, '\0');
    for (const int window : {MAX_WBITS, MAX_WBITS + 16}) {
        write(folder / "a.mha", meta("CompressedData = False\n") + "LOCAL\n" + packed(zeros, window));
        EXPECT_THAT(message_of<IoError>([&] { read_volume(folder / "a.mha"); }), HasSubstr("CompressedData = True"));
    }
}

/// An NRRD header of 3 x 4 x 5 bytes; `more` ends in the data, or in the line of their file.
std::string nrrd(const std::string& space, const std::string& directions, const std::string& more) {
    return "NRRD0005\ntype: uint8\ndimension: 3\n" + space + "sizes: 3 4 5\nspace directions: " + directions +
           "\nkinds: domain domain domain\nencoding: raw\nspace origin: (10,20,30)\n" + more;
}
const std::string upright = "(2,0,0) (0,3,0) (0,0,4)";

TEST(Nrrd, EveryOrderAndSignOfTheAxesLandsInLps) {
    // The sentence of the format: the world's axes increase towards left or right, posterior or anterior, superior or
    // inferior, in the order in which the space names them.
    const TemporaryFolder folder;
    const std::array<std::array<const char*, 2>, 3> words{
        {{"left", "right"}, {"posterior", "anterior"}, {"superior", "inferior"}}};
    std::array<std::size_t, 3> order{0, 1, 2};
    int tested = 0;
    do {
        for (unsigned signs = 0; signs < 8; ++signs) {
            std::string name, letters;
            Eigen::Vector3d origin, corner;
            for (std::size_t world = 0; world < 3; ++world) {
                const std::size_t axis = order[world], negative = signs >> world & 1U;
                name += world ? "-" : "";
                name += words[axis][negative];
                letters += static_cast<char>(std::toupper(words[axis][negative][0]));
                const double sign = negative ? -1.0 : 1.0;
                const auto row = static_cast<Eigen::Index>(axis), w = static_cast<Eigen::Index>(world);
                origin[row] = sign * Eigen::Vector3d(10, 20, 30)[w];
                corner[row] = origin[row] + sign * Eigen::Vector3d(4, 9, 16)[w];
            }
            for (const std::string& space : {name, letters}) {
                SCOPED_TRACE(space);
                write(folder / "a.nrrd", nrrd("space: " + space + "\n", upright, "\n" + counted_bytes()));
                const ReadResult read = read_volume_with_notes(folder / "a.nrrd");
                EXPECT_TRUE(read.volume.geometry.origin.isApprox(origin, 1e-12));
                EXPECT_TRUE(read.volume.geometry.point({2, 3, 4}).isApprox(corner, 1e-12));
                EXPECT_TRUE(read.notes.empty());
                ++tested;
            }
        }
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_EQ(tested, 96);
}

TEST(Nrrd, SpacesThatNameNoPatientAreNotedOrRefused) {
    const TemporaryFolder folder;
    write(folder / "a.nrrd", nrrd("space: scanner-xyz\n", upright, "\n" + counted_bytes()));
    EXPECT_THAT(read_volume_with_notes(folder / "a.nrrd").notes, ElementsAre(HasSubstr("scanner-xyz")));
    write(folder / "a.nrrd", nrrd("space dimension: 3\n", upright, "\n" + counted_bytes()));
    EXPECT_THAT(read_volume_with_notes(folder / "a.nrrd").notes, ElementsAre(HasSubstr("names no space")));
    for (const char* space : {"left-right-superior", "left-posterior", "somewhere"}) {
        write(folder / "a.nrrd", nrrd(std::string("space: ") + space + "\n", upright, "\n" + counted_bytes()));
        EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.nrrd"); }), HasSubstr(space));
    }
}

TEST(Nrrd, UnitsAreConvertedAndUnknownOnesRefused) {
    const TemporaryFolder folder;
    const auto read = [&](const std::string& field) {
        write(folder / "a.nrrd", nrrd("space: LPS\n", upright, field + "\n\n" + counted_bytes()));
        return read_volume_with_notes(folder / "a.nrrd");
    };
    const ReadResult cm = read("space units: \"cm\" \"cm\" \"cm\"");
    EXPECT_TRUE(cm.volume.geometry.spacing.isApprox(Eigen::Vector3d(20, 30, 40)));
    EXPECT_TRUE(cm.volume.geometry.origin.isApprox(Eigen::Vector3d(100, 200, 300)));
    EXPECT_THAT(cm.notes, ElementsAre(HasSubstr("given in cm")));
    const ReadResult micro = read("space units: \"\xc2\xb5m\" \"um\" \"micrometers\"");
    EXPECT_TRUE(micro.volume.geometry.origin.isApprox(Eigen::Vector3d(0.01, 0.02, 0.03)));
    const ReadResult mixed = read("space units: \"mm\" \"mm\" \"m\"");
    EXPECT_TRUE(mixed.volume.geometry.origin.isApprox(Eigen::Vector3d(10, 20, 30000)));
    EXPECT_TRUE(read("units: \"cm\" \"cm\" \"cm\"").volume.geometry.origin.isApprox(Eigen::Vector3d(100, 200, 300)));
    EXPECT_TRUE(read("space units: \"mm\" \"mm\" \"mm\"").notes.empty());
    EXPECT_TRUE(read("space units: \"\" \"\" \"\"").notes.empty());
    EXPECT_TRUE(
        read("space units: inches inches inch").volume.geometry.origin.isApprox(Eigen::Vector3d(254, 508, 762)));
    EXPECT_THAT(message_of<InvalidInput>([&] { read("space units: \"furlong\" \"mm\" \"mm\""); }),
                HasSubstr("furlong"));
}

TEST(Nrrd, SpacingsAlongAxesHaveUnitsAndOriginsOfTheirOwn) {
    const TemporaryFolder folder;
    const std::string header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 5\nencoding: raw\n";
    write(folder / "a.nrrd", header +
                                 "spacings: 0.2 3 4\nunits: \"cm\" \"mm\" \"mm\"\naxis mins: 1 20 30\n"
                                 "centers: node cell cell\n\n" +
                                 counted_bytes());
    const Geometry grid = read_volume(folder / "a.nrrd").geometry;
    EXPECT_TRUE(grid.spacing.isApprox(Eigen::Vector3d(2, 3, 4)));
    EXPECT_TRUE(grid.origin.isApprox(Eigen::Vector3d(10, 21.5, 32)));
    write(folder / "a.nrrd", header + "\n" + counted_bytes());
    EXPECT_THAT(read_volume_with_notes(folder / "a.nrrd").notes,
                ElementsAre(HasSubstr("names no space"), HasSubstr("states no spacing")));
    write(folder / "a.nrrd",
          header + "axis mins: 10 20 30\naxis maxs: 14 32 50\ncenters: node cell cell\n\n" + counted_bytes());
    const ReadResult ends = read_volume_with_notes(folder / "a.nrrd");
    EXPECT_TRUE(ends.volume.geometry.spacing.isApprox(Eigen::Vector3d(2, 3, 4)));
    EXPECT_TRUE(ends.volume.geometry.origin.isApprox(Eigen::Vector3d(10, 21.5, 32)));
    EXPECT_THAT(ends.notes, ElementsAre(HasSubstr("names no space")));
}

TEST(Nrrd, DetachedDataInListsPatternsAndBehindHeadersAreRead) {
    const TemporaryFolder folder;
    write_slices(folder.path());
    write(folder / "whole.raw", "line one\nline two\n" + counted_bytes());
    const auto read = [&](const std::string& fields) {
        SCOPED_TRACE(fields);
        write(folder / "a.nhdr", nrrd("space: LPS\n", upright, fields));
        expect_counted(read_volume(folder / "a.nhdr"));
    };
    read("data file: LIST\ns1.raw\ns2.raw\ns3.raw\ns4.raw\ns5.raw\n");
    read("data file: s%d.raw 1 5 1\n");
    read("line skip: 2\ndata file: whole.raw\n");
    read("byte skip: 18\ndata file: ./whole.raw\n");
    read("byte skip: -1\ndatafile: whole.raw\n");
    const auto refusal = [&](const std::string& fields) {
        write(folder / "a.nhdr", nrrd("space: LPS\n", upright, fields));
        return message_of<Error>([&] { read_volume(folder / "a.nhdr"); });
    };
    EXPECT_THAT(refusal("data file: LIST\ns1.raw\ns2.raw\n"), HasSubstr("2 files for the 5 slices"));
    EXPECT_THAT(refusal("data file: s%d.raw 1 4 1\n"), HasSubstr("4 files"));
    EXPECT_THAT(refusal("data file: whole.raw\n"), HasSubstr("does not fit"));
    EXPECT_THAT(refusal("byte skip: 40\ndata file: whole.raw\n"), HasSubstr("cut short"));
    EXPECT_THAT(refusal("data file: nowhere.raw\n"), HasSubstr("nowhere.raw"));
}

TEST(Nrrd, EveryEncodingIsReadOrNamed) {
    const TemporaryFolder folder;
    std::string text, hex;
    for (int i = 1; i <= 60; ++i) {
        text += std::to_string(i) + " ";
        std::array<char, 3> digits{};
        std::snprintf(digits.data(), digits.size(), "%02x", static_cast<unsigned>(i));
        hex += std::string(digits.data()) + (i % 9 ? "" : "\n");
    }
    const auto with = [&](const std::string& encoding, const std::string& data) {
        std::string header = nrrd("space: LPS\n", upright, "\n");
        header.replace(header.find("encoding: raw"), 13, "encoding: " + encoding);
        write(folder / "a.nrrd", header + data);
        return folder / "a.nrrd";
    };
    expect_counted(read_volume(with("gzip", packed(counted_bytes(), MAX_WBITS + 16))));
    expect_counted(read_volume(with("gz", packed(counted_bytes()))));
    expect_counted(read_volume(with("ascii", text)));
    expect_counted(read_volume(with("hex", hex)));
    EXPECT_THROW(read_volume(with("hex", hex.substr(3))), IoError);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(with("bzip2", "BZh")); }), HasSubstr("'bzip2'"));
}

TEST(Nrrd, ValuesOfManyBytesMustSayTheirOrder) {
    const TemporaryFolder folder;
    std::string header = nrrd("space: LPS\n", upright, "\n");
    header.replace(header.find("uint8"), 5, "int16");
    write(folder / "a.nrrd", header + std::string(120, 'a'));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "a.nrrd"); }), HasSubstr("byte order"));
}

TEST(Nrrd, VectorsAreTurnedFromTheHeadersSpace) {
    const TemporaryFolder folder;
    std::vector<float> vectors;
    for (int i = 0; i < 8; ++i) vectors.insert(vectors.end(), {1.0F, 2.0F, 3.0F});
    const std::string data(reinterpret_cast<const char*>(vectors.data()), 4 * vectors.size());
    std::vector<std::string> notes;
    const auto read = [&](const std::string& fields) {
        write(folder / "a.nrrd",
              "NRRD0004\ntype: float\ndimension: 4\nsizes: 3 2 2 2\nkinds: vector domain domain domain\n"
              "space directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n"
              "endian: little\nencoding: raw\n" +
                  fields + "\n" + data);
        const ReadResult result = read_volume_with_notes(folder / "a.nrrd");
        notes = result.notes;
        return result.volume.voxels.at<cv::Vec3f>(1, 1, 1);
    };
    EXPECT_EQ(read("space: left-posterior-superior\n"), cv::Vec3f(1, 2, 3));
    EXPECT_TRUE(notes.empty());
    EXPECT_EQ(read("space: right-anterior-superior\n"), cv::Vec3f(-1, -2, 3));
    EXPECT_THAT(notes, ElementsAre(HasSubstr("vectors were turned to LPS")));
    EXPECT_EQ(read("space: left-posterior-superior\nmeasurement frame: (0,1,0) (-1,0,0) (0,0,1)\n"),
              cv::Vec3f(-2, 1, 3));
    EXPECT_EQ(read("space: left-posterior-superior\nspace units: \"cm\" \"cm\" \"mm\"\n"), cv::Vec3f(10, 20, 3));
    EXPECT_THAT(notes, ElementsAre(HasSubstr("given in cm"), HasSubstr("its vectors are taken in the unit")));
    EXPECT_THAT(message_of<IoError>([&] { read("space: LPS\nspace: RAS\n"); }),
                HasSubstr("states 'space' twice, 'LPS' and 'RAS'"));
}

/// A segmentation of 3D Slicer with layers in front, 2 x 2 x 2 voxels.
std::string segmentation(int layers, const std::string& segments, const std::string& data) {
    return "NRRD0004\ntype: uint8\ndimension: 4\nspace: LPS\nsizes: " + std::to_string(layers) +
           " 2 2 2\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: list domain domain domain\nencoding: raw\n"
           "space origin: (0,0,0)\n" +
           segments + "\n" + data;
}
std::string segment(int number, const std::string& name, int value, int layer) {
    const std::string key = std::string("Segment") + std::to_string(number) + "_";
    return key + "ID:=" + key + "id\n" + key + "Name:=" + name + "\n" + key + "LabelValue:=" + std::to_string(value) +
           "\n" + key + "Layer:=" + std::to_string(layer) + "\n";
}
std::string layered(std::initializer_list<std::array<char, 2>> voxels) {
    std::string data;
    for (const auto& voxel : voxels) data += std::string{voxel[0], voxel[1]};
    return data;
}

TEST(Segmentation, LayersBecomeOneLabelMapWithNames) {
    const TemporaryFolder folder;
    const std::string data = layered({{1, 0}, {1, 0}, {0, 0}, {0, 2}, {0, 2}, {0, 0}, {0, 0}, {0, 0}});
    write(folder / "a.seg.nrrd", segmentation(2, segment(0, "liver", 1, 0) + segment(1, "tumour", 2, 1), data));
    const ReadResult read = read_labels_with_notes(folder / "a.seg.nrrd");
    EXPECT_EQ(std::vector<int>(read.volume.data<int>(), read.volume.data<int>() + 5),
              (std::vector<int>{1, 1, 0, 2, 2}));
    EXPECT_EQ(read.label_names, (std::map<int, std::string>{{1, "liver"}, {2, "tumour"}}));
    EXPECT_TRUE(read.notes.empty());
}

TEST(Segmentation, NumbersOfSegmentsMayHaveGaps) {
    const TemporaryFolder folder;
    const std::string data = layered({{1, 0}, {1, 0}, {0, 0}, {0, 2}, {0, 2}, {0, 0}, {0, 0}, {0, 0}});
    write(folder / "a.seg.nrrd", segmentation(2, segment(1, "liver", 1, 0) + segment(12, "tumour", 2, 1), data));
    const ReadResult read = read_labels_with_notes(folder / "a.seg.nrrd");
    EXPECT_EQ(read.label_names, (std::map<int, std::string>{{1, "liver"}, {2, "tumour"}}));
    EXPECT_TRUE(read.notes.empty());
}

TEST(Segmentation, LabelValuesThatRepeatAreNumberedAnewWithANote) {
    const TemporaryFolder folder;
    const std::string data = layered({{1, 0}, {1, 0}, {0, 0}, {0, 1}, {0, 1}, {0, 0}, {0, 3}, {0, 0}});
    write(folder / "a.seg.nrrd", segmentation(2, segment(0, "liver", 1, 0) + segment(1, "tumour", 1, 1), data));
    const ReadResult read = read_labels_with_notes(folder / "a.seg.nrrd");
    EXPECT_EQ(std::vector<int>(read.volume.data<int>(), read.volume.data<int>() + 7),
              (std::vector<int>{1, 1, 0, 2, 2, 0, 3}));
    EXPECT_EQ(read.label_names, (std::map<int, std::string>{{1, "liver"}, {2, "tumour"}}));
    EXPECT_THAT(read.notes,
                ElementsAre(HasSubstr("1 'liver', 2 'tumour'"), HasSubstr("without a segment of their own: 3")));
}

TEST(Segmentation, OverlapsAreRefusedByName) {
    const TemporaryFolder folder;
    const std::string data = layered({{1, 2}, {1, 2}, {0, 0}, {0, 2}, {0, 2}, {0, 0}, {0, 0}, {0, 0}});
    write(folder / "a.seg.nrrd", segmentation(2, segment(0, "liver", 1, 0) + segment(1, "tumour", 2, 1), data));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_labels(folder / "a.seg.nrrd"); }),
                testing::AllOf(HasSubstr("'liver' and 'tumour' overlap in 2 voxels"), HasSubstr("a.seg.nrrd")));
}

TEST(Segmentation, ManyLayersAreNoVectors) {
    const TemporaryFolder folder;
    std::string data(24, '\0');
    data[0] = 1, data[4] = 1, data[8] = 1;  // voxel 0 of layer 0, 1 of 1, 2 of 2
    write(folder / "a.seg.nrrd",
          segmentation(3, segment(0, "a", 1, 0) + segment(1, "b", 1, 1) + segment(2, "c", 1, 2), data));
    const Volume labels = read_volume(folder / "a.seg.nrrd");
    EXPECT_EQ(std::vector<int>(labels.data<int>(), labels.data<int>() + 4), (std::vector<int>{1, 2, 3, 0}));
    std::string four = segmentation(4, "", std::string(32, '\0'));
    write(folder / "four.nrrd", four);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "four.nrrd"); }), HasSubstr("hold 4 values"));
}

TEST(Labels, AGreyImageIsRefusedAtOnce) {
    const TemporaryFolder folder;
    write_volume(test::random_volume(test::plain_grid({20, 20, 20}), CV_16S), folder / "grey.nrrd");
    EXPECT_THAT(message_of<InvalidInput>([&] { read_labels(folder / "grey.nrrd"); }),
                testing::AllOf(HasSubstr("grey image"), HasSubstr("grey.nrrd")));
    Volume organs(test::plain_grid({40, 40, 40}), CV_16S);  // 50 labels, 2 % of voxels drawn at random
    cv::RNG random(3);
    for (int i = 0; i < 64000; ++i)
        organs.data<short>()[i] = static_cast<short>(random.uniform(0, 50) == 0 ? random.uniform(1, 51) : 1 + i / 1280);
    write_volume(organs, folder / "organs.nrrd");
    EXPECT_EQ(read_labels(folder / "organs.nrrd").geometry.size[0], 40);
}

}  // namespace
}  // namespace tissuewarp::imaging
