/// DICOM files of many frames: each frame has a place, a slope and a segment of its own.

#include "core/errors.hpp"
#include "dicom_elements.hpp"
#include "imaging/image_io.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <numeric>

namespace tissuewarp::imaging {
namespace {

using test::decimals;
using test::Elements;
using test::message_of;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

/// One frame of a file: which slice of the volume it shows, and what it says of itself.
struct Frame {
    int k = 0;
    double slope = 1.0;
    std::string stack{};
    int segment = 0;
    bool placed = true;
};

struct FileOptions {
    std::string series = "1.2.3.4";
    int bits_stored = 0;                                      ///< as many as a value takes when 0
    std::string image_class = "1.2.840.10008.5.1.4.1.1.2.1";  // Enhanced CT
    std::string modality = "CT";
    const char* transfer_syntax = test::explicit_little_endian;
};

std::string one(double value) {
    return decimals(Eigen::VectorXd::Constant(1, value));
}

std::vector<Frame> in_order(int count) {
    std::vector<Frame> frames(static_cast<std::size_t>(count));
    for (int k = 0; k < count; ++k) frames[static_cast<std::size_t>(k)].k = k;
    return frames;
}

Eigen::VectorXd axes_of(const Geometry& grid) {
    Eigen::VectorXd axes(6);
    axes << grid.direction.col(0), grid.direction.col(1);
    return axes;
}

/// Attributes before the pixels: shared axes and spacing, a functional group a frame.
Elements described(const Geometry& grid, const std::vector<Frame>& frames, const FileOptions& options, int bits) {
    Elements data;
    data.text(8, 0x16, "UI", options.image_class);
    data.text(8, 0x60, "CS", options.modality);
    data.text(0x20, 0xe, "UI", options.series);
    if (options.modality == "RTDOSE") {  // one position for all frames
        data.text(0x20, 0x32, "DS", decimals(grid.origin));
        data.text(0x20, 0x37, "DS", decimals(axes_of(grid)));
    }
    data.short_value(0x28, 2, 1);
    data.text(0x28, 4, "CS", "MONOCHROME2");
    data.text(0x28, 8, "IS", std::to_string(frames.size()));
    data.short_value(0x28, 0x10, grid.size[1]);
    data.short_value(0x28, 0x11, grid.size[0]);
    if (options.modality == "RTDOSE")
        data.text(0x28, 0x30, "DS", decimals(Eigen::Vector2d(grid.spacing[1], grid.spacing[0])));
    data.short_value(0x28, 0x100, bits);
    const int stored = options.bits_stored > 0 ? options.bits_stored : bits;
    data.short_value(0x28, 0x101, stored);
    data.short_value(0x28, 0x102, stored - 1);
    data.short_value(0x28, 0x103, bits == 16 ? 1 : 0);
    return data;
}

void add_groups(Elements& data, const Geometry& grid, const std::vector<Frame>& frames) {
    Elements orientation, measures, shared;
    orientation.text(0x20, 0x37, "DS", decimals(axes_of(grid)));
    measures.text(0x18, 0x50, "DS", one(grid.spacing[2]));
    measures.text(0x28, 0x30, "DS", decimals(Eigen::Vector2d(grid.spacing[1], grid.spacing[0])));
    shared.sequence(0x20, 0x9116, {orientation});
    shared.sequence(0x28, 0x9110, {measures});
    data.sequence(0x5200, 0x9229, {shared});
    std::vector<Elements> own;
    for (const Frame& frame : frames) {
        Elements content, position, transformation, segment, groups;
        if (!frame.stack.empty()) content.text(0x20, 0x9056, "SH", frame.stack);
        groups.sequence(0x20, 0x9111, {content});
        position.text(0x20, 0x32, "DS", decimals(grid.point({0, 0, 1.0 * frame.k})));
        if (frame.placed) groups.sequence(0x20, 0x9113, {position});
        transformation.text(0x28, 0x1052, "DS", "0");
        transformation.text(0x28, 0x1053, "DS", one(frame.slope));
        groups.sequence(0x28, 0x9145, {transformation});
        segment.short_value(0x62, 0xb, frame.segment);
        if (frame.segment > 0) groups.sequence(0x62, 0xa, {segment});
        own.push_back(groups);
    }
    data.sequence(0x5200, 0x9230, own);
}

/// RLE of values of two bytes: the high bytes and the low bytes of a frame, each in literal runs.
std::vector<std::string> run_length_frames(const std::vector<std::int16_t>& pixels, std::size_t frames) {
    std::vector<std::string> packed;
    const std::size_t count = pixels.size() / frames;
    for (std::size_t frame = 0; frame < frames; ++frame) {
        std::array<std::string, 2> planes;
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t plane = 0; plane < 2; ++plane)
                (planes[plane] += '\0') += static_cast<char>(pixels[frame * count + i] >> (plane == 0 ? 8 : 0));
        std::string header(64, '\0');
        header[0] = 2, header[4] = 64;
        const auto second = static_cast<std::uint16_t>(64 + planes[0].size());
        header[8] = static_cast<char>(second & 0xff), header[9] = static_cast<char>(second >> 8);
        packed.push_back(header + planes[0] + planes[1]);
    }
    return packed;
}

void write_frames(const std::filesystem::path& path, const Volume& volume, const std::vector<Frame>& frames,
                  const FileOptions& options = {}) {
    const Geometry& grid = volume.geometry;
    Elements data = described(grid, frames, options, 16);
    add_groups(data, grid, frames);
    std::vector<std::int16_t> pixels;
    for (const Frame& frame : frames) {
        const short* first = volume.data<short>() + volume.offset(0, 0, frame.k);
        pixels.insert(pixels.end(), first, first + grid.size[0] * grid.size[1]);
    }
    if (options.transfer_syntax == test::run_lengths)
        data.fragments(run_length_frames(pixels, frames.size()));
    else
        data.words(0x7fe0, 0x10, pixels);
    write_dicom(path, options.image_class, "1.2.3.9", data, options.transfer_syntax);
}

Volume ct_volume() {
    return test::random_volume(test::oblique_grid({7, 9, 6}), CV_16S);
}

void expect_same(const Volume& read, const Volume& written) {
    EXPECT_TRUE(test::same_voxels(read.voxels, written.voxels));
    EXPECT_LT(grid_distance(read.geometry, written.geometry), 1e-4);
}

TEST(DicomFrames, AreSortedByTheirOwnPositions) {
    const TemporaryFolder folder;
    for (const std::vector<int>& order : {std::vector{0, 1, 2, 3, 4, 5}, {5, 4, 3, 2, 1, 0}, {0, 2, 4, 1, 3, 5}}) {
        std::vector<Frame> frames;
        for (const int k : order) frames.push_back({.k = k});
        write_frames(folder / "mf.dcm", ct_volume(), frames);
        expect_same(read_volume(folder.path()), ct_volume());
        expect_same(read_volume(folder / "mf.dcm"), ct_volume());
    }
}

TEST(DicomFrames, EachHasItsOwnSlope) {
    const TemporaryFolder folder;
    std::vector<Frame> frames = in_order(6);
    for (Frame& frame : frames) frame.slope = 1.0 + 0.25 * frame.k;
    std::swap(frames[1], frames[4]);
    write_frames(folder / "mf.dcm", ct_volume(), frames);
    const Volume read = read_volume(folder.path()).as(CV_64F), volume = ct_volume();
    for (int k = 0; k < 6; ++k) {
        const auto at = volume.offset(3, 4, k);
        EXPECT_NEAR(read.data<double>()[at], (1.0 + 0.25 * k) * volume.data<short>()[at], 1e-4);
    }
}

TEST(DicomFrames, SeveralFilesOfOneSeriesAreOneVolume) {
    const TemporaryFolder folder;
    write_frames(folder / "a.dcm", ct_volume(), {{.k = 4}, {.k = 0}, {.k = 2}});
    write_frames(folder / "b.dcm", ct_volume(), {{.k = 5}, {.k = 1}, {.k = 3}});
    expect_same(read_volume(folder.path()), ct_volume());
    write_frames(folder / "c.dcm", ct_volume(), {{.k = 3}});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }),
                testing::AllOf(HasSubstr("same position"), HasSubstr("frame 3 of 'b.dcm'"), HasSubstr("'c.dcm'")));
    write_frames(folder / "c.dcm", ct_volume(), {{.k = 3}}, {.series = "1.2.3.5"});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder.path()); }), HasSubstr("2 series"));
}

TEST(DicomFrames, DeflatedAndRunLengthFilesAreRead) {
    const TemporaryFolder folder;
    Volume volume = ct_volume();
    for (int i = 0; i < 100; ++i) volume.data<short>()[i] = static_cast<short>(-1000 + 37 * i);
    for (const char* syntax : {test::deflated, test::run_lengths}) {
        SCOPED_TRACE(syntax);
        write_frames(folder / "mf.dcm", volume, in_order(6), {.transfer_syntax = syntax});
        expect_same(read_volume(folder / "mf.dcm"), volume);
        std::filesystem::resize_file(folder / "mf.dcm", std::filesystem::file_size(folder / "mf.dcm") - 40);
        EXPECT_THROW(read_volume(folder / "mf.dcm"), IoError);
    }
}

TEST(DicomFrames, BitsBesideTheStoredOnesDoNotCount) {
    const TemporaryFolder folder;
    Volume stored = ct_volume(), meant = ct_volume();
    // 12 bits with a sign, an overlay in the bit above.
    for (int i = 0; i < 200; ++i) {
        meant.data<short>()[i] = static_cast<short>(i - 100);
        stored.data<short>()[i] = static_cast<short>((meant.data<short>()[i] & 0x0fff) | (i % 2 << 12));
    }
    write_frames(folder / "mf.dcm", stored, in_order(6), {.bits_stored = 12});
    expect_same(read_volume(folder / "mf.dcm"), meant);
}

TEST(DicomFrames, AFileCutWithinItsHeaderIsAnError) {
    const TemporaryFolder folder;
    write_frames(folder / "mf.dcm", ct_volume(), in_order(6));
    for (const std::uintmax_t bytes : {1500U, 1000U, 600U, 300U, 200U, 140U}) {
        std::filesystem::resize_file(folder / "mf.dcm", bytes);
        EXPECT_THROW(read_volume(folder / "mf.dcm"), Error) << bytes;
    }
}

TEST(DicomFrames, GapsTwoStacksAndMissingPositionsAreRefused) {
    const TemporaryFolder folder;
    write_frames(folder / "mf.dcm", ct_volume(), {{.k = 0}, {.k = 1}, {.k = 2}, {.k = 4}, {.k = 5}});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "mf.dcm"); }),
                HasSubstr("missing or uneven: 5 mm"));
    std::vector<Frame> frames = in_order(6);
    for (Frame& frame : frames) frame.stack = frame.k < 3 ? "A" : "B";
    write_frames(folder / "mf.dcm", ct_volume(), frames);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "mf.dcm"); }),
                HasSubstr("2 stacks ('A': 3 frames, 'B': 3 frames)"));
    frames = in_order(6);
    frames.insert(frames.end(), frames.begin(), frames.end());
    write_frames(folder / "mf.dcm", ct_volume(), frames);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "mf.dcm"); }), HasSubstr("same position"));
    write_frames(folder / "mf.dcm", ct_volume(), std::vector<Frame>(6));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "mf.dcm"); }),
                HasSubstr("its 6 frames lie at one position"));
    frames = in_order(6);
    frames[3].placed = false;
    write_frames(folder / "mf.dcm", ct_volume(), frames);
    EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(folder / "mf.dcm"); }),
                testing::AllOf(HasSubstr("frame 4"), HasSubstr("states no position")));
}

// Frames of a screen, without functional groups: no place in the patient.
TEST(DicomFrames, ASecondaryCaptureIsNoVolume) {
    const TemporaryFolder folder;
    const Geometry grid = ct_volume().geometry;
    Elements data = described(grid, in_order(6), {.modality = "OT"}, 16);
    data.words(0x7fe0, 0x10, std::vector<std::int16_t>(static_cast<std::size_t>(grid.voxel_count())));
    write_dicom(folder / "sc.dcm", "1.2.840.10008.5.1.4.1.1.7.3", "1.2.3.9", data);
    for (const auto& path : {folder / "sc.dcm", folder.path()})
        EXPECT_THAT(message_of<InvalidInput>([&] { read_volume(path); }),
                    testing::AllOf(HasSubstr("states no position"), HasSubstr("a secondary capture")));
}

TEST(DicomFrames, AFileThatIsCutShortIsAnError) {
    const TemporaryFolder folder;
    write_frames(folder / "mf.dcm", ct_volume(), in_order(6));
    std::filesystem::resize_file(folder / "mf.dcm", std::filesystem::file_size(folder / "mf.dcm") - 20);
    EXPECT_THROW(read_volume(folder / "mf.dcm"), IoError);
}

const FileOptions segmentation{.image_class = "1.2.840.10008.5.1.4.1.1.66.4", .modality = "SEG"};

/// 6 x 4 x 5 voxels of labels 1 (an even block) and 2.
Volume label_volume() {
    Volume labels(test::oblique_grid({6, 4, 5}), CV_16S);
    for (int k = 0; k < 5; ++k)
        for (int j = 0; j < 4; ++j)
            for (int i = 0; i < 6; ++i)
                if (k != 2)
                    labels.data<short>()[labels.offset(i, j, k)] =
                        static_cast<short>(i < 3 ? (k < 4 ? 1 : 0) : (j < 2 ? 2 : 0));
    return labels;
}

Elements segment_description(int number, const std::string& name) {
    Elements segment;
    segment.short_value(0x62, 4, number);
    segment.text(0x62, 5, "LO", name);
    return segment;
}

/// Bits of the frames, joined, or packed by RLE a frame; every frame shows the voxels of its segment.
void write_segmentation(const std::filesystem::path& path, const Volume& labels, const std::vector<Frame>& frames,
                        bool packed = false, const std::string& type = "BINARY",
                        const std::string& first_name = "liver") {
    const Geometry& grid = labels.geometry;
    const bool bits = type == "BINARY";
    Elements data = described(grid, frames, segmentation, bits ? 1 : 8);
    data.text(0x62, 1, "CS", type);
    data.sequence(0x62, 2, {segment_description(1, first_name), segment_description(2, "tumour")});
    data.short_value(0x62, 0xe, 200);
    add_groups(data, grid, frames);
    std::string joined;
    std::vector<std::string> single;
    std::size_t count = 0;
    for (const Frame& frame : frames) {
        std::string own(3, '\0');  // 24 pixels
        for (int pixel = 0; pixel < 24; ++pixel, ++count) {
            const short label = labels.data<short>()[labels.offset(0, 0, frame.k) + pixel];
            const bool inside = label == frame.segment;
            if (!bits) {
                joined += static_cast<char>(type == "FRACTIONAL" ? (inside ? 120 : 80) : label);
                continue;
            }
            if (count / 8 == joined.size()) joined += '\0';
            joined[count / 8] = static_cast<char>(joined[count / 8] | inside << count % 8);
            own[static_cast<std::size_t>(pixel / 8)] =
                static_cast<char>(own[static_cast<std::size_t>(pixel / 8)] | inside << pixel % 8);
        }
        std::string header(64, '\0');
        header[0] = 1, header[4] = 64;
        single.push_back(header + '\2' + own);
    }
    if (packed)
        data.fragments(single);
    else
        data.bytes_value(0x7fe0, 0x10, joined);
    write_dicom(path, segmentation.image_class, "1.2.3.9", data,
                packed ? test::run_lengths : test::explicit_little_endian);
}

/// Frames where a segment has voxels, the second segment first.
std::vector<Frame> segment_frames() {
    return {{.k = 4, .segment = 2}, {.k = 0, .segment = 2}, {.k = 1, .segment = 2}, {.k = 3, .segment = 2},
            {.k = 0, .segment = 1}, {.k = 3, .segment = 1}, {.k = 1, .segment = 1}};
}

TEST(DicomSegmentation, IsReadBySegmentNumberWithNames) {
    const TemporaryFolder folder;
    for (const bool packed : {false, true}) {
        SCOPED_TRACE(packed);
        write_segmentation(folder / "seg.dcm", label_volume(), segment_frames(), packed);
        const ReadResult read = read_labels_with_notes(folder / "seg.dcm");
        expect_same(read.volume.as(CV_16S), label_volume());  // slice 2 holds no segment and has no frame
        EXPECT_EQ(read.label_names, (std::map<int, std::string>{{1, "liver"}, {2, "tumour"}}));
        EXPECT_TRUE(read.notes.empty());
    }
}

TEST(DicomSegmentation, OneNumberWithTwoNamesIsRefused) {
    const TemporaryFolder folder;
    const std::vector<Frame> frames = segment_frames();
    write_segmentation(folder / "a.dcm", label_volume(), {frames.begin(), frames.begin() + 4});
    write_segmentation(folder / "b.dcm", label_volume(), {frames.begin() + 4, frames.end()}, false, "BINARY", "spleen");
    EXPECT_THAT(message_of<InvalidInput>([&] { read_labels(folder.path()); }),
                HasSubstr("segment 1 is 'liver' in a.dcm and 'spleen' in b.dcm"));
}

TEST(DicomSegmentation, OverlapsAreRefusedByName) {
    const TemporaryFolder folder;
    Volume labels = label_volume();
    std::vector<Frame> frames = segment_frames();
    // The second file claims for the tumour what the first claims for the liver.
    write_segmentation(folder / "a.dcm", labels, frames);
    labels.data<short>()[labels.offset(1, 1, 0)] = 2;
    write_segmentation(folder / "b.dcm", labels, {{.k = 0, .segment = 2}});
    EXPECT_THAT(message_of<InvalidInput>([&] { read_labels(folder.path()); }), HasSubstr("overlap in 1 voxels"));
    EXPECT_THAT(message_of<InvalidInput>([&] { read_labels(folder.path()); }),
                testing::AllOf(HasSubstr("'liver'"), HasSubstr("'tumour'")));
}

TEST(DicomSegmentation, FractionsAndLabelMapsAreRead) {
    const TemporaryFolder folder;
    write_segmentation(folder / "seg.dcm", label_volume(), segment_frames(), false, "FRACTIONAL");
    const ReadResult fractions = read_labels_with_notes(folder / "seg.dcm");
    expect_same(fractions.volume.as(CV_16S), label_volume());
    EXPECT_THAT(fractions.notes, ElementsAre(HasSubstr("fractional")));
    write_segmentation(folder / "seg.dcm", label_volume(), in_order(5), false, "LABELMAP");
    expect_same(read_labels(folder / "seg.dcm").as(CV_16S), label_volume());
}

TEST(DicomFrames, PlanesOfADoseLieAtTheirOffsets) {
    const TemporaryFolder folder;
    const Volume volume = ct_volume();
    const Geometry& grid = volume.geometry;
    Elements data =
        described(grid, in_order(6), {.image_class = "1.2.840.10008.5.1.4.1.1.481.2", .modality = "RTDOSE"}, 16);
    Eigen::VectorXd offsets(6);
    offsets << 0, 2.5, 5, 7.5, 10, 12.5;
    data.text(0x3004, 0xc, "DS", decimals(offsets));
    data.text(0x3004, 0xe, "DS", "0.5");
    data.words(0x7fe0, 0x10, {volume.data<short>(), volume.data<short>() + grid.voxel_count()});
    write_dicom(folder / "dose.dcm", "1.2.840.10008.5.1.4.1.1.481.2", "1.2.3.9", data);
    const Volume read = read_volume(folder / "dose.dcm");
    EXPECT_LT(grid_distance(read.geometry, grid), 1e-4);
    EXPECT_NEAR(read.as(CV_64F).data<double>()[100], 0.5 * volume.data<short>()[100], 1e-6);
}

}  // namespace
}  // namespace tissuewarp::imaging
