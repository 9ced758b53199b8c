/// Sweeps of a tracked probe: which way leads from pixels to the patient, which frames count, and what is refused.
#include "imaging/sweep.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

namespace tissuewarp::imaging {
namespace {

using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string numbers(const Eigen::Affine3d& transform) {
    std::string text;
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column) text += std::to_string(transform.matrix()(row, column)) + " ";
    return text;
}

/// A file of Plus with frames of 4 × 3 pixels.
struct SweepText {
    int frames = 2;
    std::string orientation = "MF", type = "BRIGHTNESS", element = "MET_UCHAR";
    std::map<std::string, std::string> fields;  ///< of single frames, without "Seq_"

    void set(int frame, const std::string& name, const std::string& value) {
        std::string digits = std::to_string(frame);
        digits.insert(0, 4 - digits.size(), '0');
        fields["Frame" + digits + "_" + name] = value;
    }
    void set(int frame, const std::string& name, const Eigen::Affine3d& transform) {
        set(frame, name + "Transform", numbers(transform));
        set(frame, name + "TransformStatus", std::string("OK"));
    }
    [[nodiscard]] std::string text() const {
        std::string all =
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
            "DimSize = 4 3 " +
            std::to_string(frames) + "\nElementSpacing = 1 1 1\nElementType = " + element +
            "\nUltrasoundImageOrientation = " + orientation + "\nUltrasoundImageType = " + type + "\n";
        for (const auto& [name, value] : fields) all += "Seq_" + name + " = " + value + "\n";
        all += "ElementDataFile = LOCAL\n";
        for (int n = 0; n < 12 * frames; ++n) all += static_cast<char>(n + 1);
        return all;
    }
};

Eigen::Affine3d calibration() {
    return Eigen::Translation3d(-3, 4, 5) * Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()) *
           Eigen::Scaling(0.2, 0.1, 0.1);
}

Eigen::Affine3d pose(double angle, double x, double y, double z) {
    return Eigen::Translation3d(x, y, z) *
           Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d(0, 1, 1).normalized()));
}

/// A tracked probe and a tracked reference.
SweepText tracked() {
    SweepText sweep;
    for (int n = 0; n < 2; ++n) {
        sweep.set(n, "ImageToProbe", calibration());
        sweep.set(n, "ProbeToTracker", pose(0.3, 10, 20, 30 + n));
        sweep.set(n, "ReferenceToTracker", pose(-0.7, 5, 0, -4));
    }
    return sweep;
}

Eigen::Vector3d ras_to_lps(const Eigen::Vector3d& p) {
    return {-p.x(), -p.y(), p.z()};
}

void expect_refused(const SweepText& sweep, const std::string& words, const SweepOptions& options = {}) {
    const TemporaryFolder folder;
    try {
        read_sweep(folder.written("s.mha", sweep.text()), options);
        ADD_FAILURE() << "was read, where '" << words << "' was expected";
    } catch (const Error& problem) {
        EXPECT_THAT(problem.what(), HasSubstr(words));
        EXPECT_THAT(problem.what(), HasSubstr("s.mha"));
    }
}

TEST(Sweep, PixelsGoThroughProbeAndTrackerToTheReference) {
    const TemporaryFolder folder;
    const Sweep sweep = read_sweep(folder.written("s.mha", tracked().text()));
    ASSERT_EQ(sweep.frames.size(), 2u);
    EXPECT_EQ(sweep.rows(), 3);
    EXPECT_EQ(sweep.columns(), 4);
    const Eigen::Vector3d pixel(3, 2, 0);
    for (int n = 0; n < 2; ++n) {
        const Eigen::Vector3d expected =
            ras_to_lps(pose(-0.7, 5, 0, -4).inverse() * pose(0.3, 10, 20, 30 + n) * calibration() * pixel);
        const SweepFrame& frame = sweep.frames[static_cast<std::size_t>(n)];
        EXPECT_LT((frame.to_patient * pixel - expected).norm(), 1e-4);
        EXPECT_NEAR(frame.normal().norm(), 1, 1e-12);
        EXPECT_NEAR(frame.normal().dot(frame.to_patient.linear().col(0)), 0, 1e-12);
        EXPECT_EQ(sweep.pixels.at<std::uint8_t>(n, 2, 3), 12 * n + 12);
    }
}

TEST(Sweep, AnotherSystemOtherAxesAndAGivenCalibration) {
    const TemporaryFolder folder;
    const auto path = folder.written("s.mha", tracked().text());
    const Eigen::Vector3d pixel(1, 2, 0);
    const Eigen::Affine3d probe = pose(0.3, 10, 20, 30), given = Eigen::Translation3d(1, 1, 1) * calibration();
    EXPECT_LT(
        (read_sweep(path, {"Tracker", Axes::LPS, {}}).frames[0].to_patient * pixel - probe * calibration() * pixel)
            .norm(),
        1e-4);
    EXPECT_LT(
        (read_sweep(path, {"Tracker", Axes::LPS, given}).frames[0].to_patient * pixel - probe * given * pixel).norm(),
        1e-4);
}

TEST(Sweep, StoredRowsAndColumnsMayRunTheOtherWay) {
    SweepText text = tracked();
    const TemporaryFolder folder;
    const auto place = [&](const std::string& orientation, double column, double row) -> Eigen::Vector3d {
        text.orientation = orientation;
        return read_sweep(folder.written("s.mha", text.text())).frames[1].to_patient * Eigen::Vector3d(column, row, 0);
    };
    const Eigen::Vector3d expected = place("MF", 1, 0);
    EXPECT_LT((place("UF", 2, 0) - expected).norm(), 1e-12);
    EXPECT_LT((place("MN", 1, 2) - expected).norm(), 1e-12);
    EXPECT_LT((place("UNA", 2, 2) - expected).norm(), 1e-12);
}

TEST(Sweep, FramesThatAreNotOkAreLeftOutAndSaid) {
    SweepText text = tracked();
    text.set(0, "ProbeToTrackerTransformStatus", "INVALID");
    const TemporaryFolder folder;
    const Sweep sweep = read_sweep(folder.written("s.mha", text.text()));
    ASSERT_EQ(sweep.frames.size(), 1u);
    EXPECT_EQ(sweep.frames[0].slice, 1);
    ASSERT_EQ(sweep.notes.size(), 1u);
    EXPECT_THAT(sweep.notes[0], HasSubstr("1 of 2 frames"));
    text.set(1, "ImageStatus", "INVALID");
    expect_refused(text, "no frame");
}

TEST(Sweep, WhatLeadsNowhereIsRefusedWithTheSystemsThatAreThere) {
    expect_refused(tracked(), "Image, Probe, Reference, Tracker", {"World", Axes::RAS, {}});
    SweepText without = tracked();
    for (int n = 0; n < 2; ++n) without.set(n, "ImageToProbeTransformStatus", "INVALID");
    expect_refused(without, "--calibration");
}

TEST(Sweep, WhatIsNoBrightnessOrOfNoProbeIsRefused) {
    SweepText text = tracked();
    text.type = "RF_REAL";
    expect_refused(text, "RF_REAL");
    text = tracked();
    text.orientation = "FM";
    expect_refused(text, "'FM'");
    text = tracked();
    text.element = "MET_CHAR";
    expect_refused(text, "no brightness");
    text = tracked();
    text.set(1, "ImageToProbe", pose(0, 0, 0, 0) * Eigen::Scaling(20.0, 20.0, 20.0));
    expect_refused(text, "frame 1 are 20 x 20 mm");
    text = tracked();
    text.set(1, "ImageToProbeTransform", "1 0 0 0 1 0 0 0 0 0 1 0 0 0 0 1");
    expect_refused(text, "can be inverted");
    text = tracked();
    text.set(7, "Timestamp", "3");
    expect_refused(text, "a frame that it does not have");
    text = tracked();
    text.set(1, "TrackerToProbe", pose(0.3, 10, 20, 30));
    expect_refused(text, "contradicts another");
    text = tracked();
    text.fields["Frame1_ProbeToTrackerTransform"] = numbers(pose(0.3, 10, 20, 36));
    expect_refused(text, "contradicts another");
}

TEST(Sweep, FramesFarFromAllOthersAreLeftOutAndNamed) {
    SweepText text;
    text.frames = 20;
    for (int n = 0; n < 20; ++n) text.set(n, "ImageToReference", pose(0, n == 7 ? 400 : 0, 0, n) * calibration());
    const TemporaryFolder folder;
    const Sweep sweep = read_sweep(folder.written("s.mha", text.text()));
    EXPECT_EQ(sweep.frames.size(), 19u);
    ASSERT_EQ(sweep.notes.size(), 1u);
    EXPECT_THAT(sweep.notes[0], HasSubstr("left out: 7"));
}

TEST(Sweep, ClaimsOfManyFramesCostNothing) {
    SweepText text = tracked();
    text.frames = 2;
    std::string claim = text.text();
    claim.replace(claim.find("DimSize = 4 3 2"), 15, "DimSize = 4 3 200000000");
    const TemporaryFolder folder;
    EXPECT_THROW(read_sweep(folder.written("s.mha", claim)), Error);
}

TEST(Sweep, ACalibrationOfThePlaneAloneWillDo) {
    SweepText text = tracked();
    Eigen::Affine3d flat = calibration();
    flat.linear().col(2).setZero();
    for (int n = 0; n < 2; ++n) text.set(n, "ImageToProbe", flat);
    const TemporaryFolder folder;
    const Eigen::Vector3d pixel(2, 1, 0);
    const Sweep plane = read_sweep(folder.written("p.mha", text.text())),
                whole = read_sweep(folder.written("w.mha", tracked().text()));
    EXPECT_LT((plane.frames[1].to_patient * pixel - whole.frames[1].to_patient * pixel).norm(), 1e-4);
}

TEST(Sweep, IsNoVolume) {
    const TemporaryFolder folder;
    try {
        read_volume(folder.written("s.mha", tracked().text()));
        FAIL() << "frames were read as a volume";
    } catch (const InvalidInput& problem) {
        EXPECT_THAT(problem.what(), HasSubstr("tissuewarp compound"));
    }
}

TEST(Sweep, PixelsOfAMillimetreAreDoubted) {
    const TemporaryFolder folder;
    SweepText text = tracked();
    EXPECT_TRUE(read_sweep(folder.written("s.mha", text.text())).notes.empty());
    for (int n = 0; n < text.frames; ++n) text.set(n, "ImageToProbe", Eigen::Affine3d::Identity());
    EXPECT_THAT(read_sweep(folder.written("s.mha", text.text())).notes, ElementsAre(HasSubstr("never calibrated")));
}

TEST(Sweep, ManyFramesHaveALongHeader) {
    SweepText text;
    text.frames = 5000;
    for (int n = 0; n < text.frames; ++n) text.set(n, "ImageToReference", pose(0, 0, 0, n) * calibration());
    ASSERT_GT(text.text().size(), std::size_t{1} << 20);
    const TemporaryFolder folder;
    EXPECT_EQ(read_sweep(folder.written("s.mha", text.text())).frames.size(), 5000u);
}

TEST(Calibration, IsSixteenNumbersOrOfPlus) {
    const TemporaryFolder folder;
    const auto rows = folder.written("rows.txt", numbers(calibration()));
    const auto xml = folder.written(
        "plus.xml",
        "<PlusConfiguration><CoordinateDefinitions>\n<Transform From=\"Probe\" To=\"Tracker\" Matrix=\"1 0 0 0 "
        "0 1 0 0 0 0 1 0 0 0 0 1\"/>\n<Transform Error=\"0.5\" From=\"Image\" To=\"Probe\"\n  Matrix=\"" +
            numbers(calibration()) + "\" />\n</CoordinateDefinitions></PlusConfiguration>");
    EXPECT_TRUE(read_calibration(rows).isApprox(calibration(), 1e-5));
    EXPECT_TRUE(read_calibration(xml).isApprox(calibration(), 1e-5));
    EXPECT_THROW(read_calibration(folder.written("short.txt", "1 2 3")), IoError);
    EXPECT_THROW(
        read_calibration(folder.written("other.xml", "<Transform From=\"Image\" To=\"Tracker\" Matrix=\"1\">")),
        InvalidInput);
    EXPECT_THROW(read_calibration(folder / "none"), IoError);
    const std::string element = "<Transform From='Image' To='Probe' Matrix='" + numbers(calibration()) + "'/>",
                      other = "<Transform From=\"Image\" To=\"Probe\" Matrix=\"" + numbers(pose(0, 1, 2, 3)) + "\"/>";
    EXPECT_TRUE(
        read_calibration(folder.written("old.xml", "<!-- " + other + " -->" + element)).isApprox(calibration(), 1e-5));
    EXPECT_THROW(read_calibration(folder.written("two.xml", other + element)), InvalidInput);
    // Neither long nor many words are a trap.
    const std::string word(200'000, 'A');
    EXPECT_THROW(read_calibration(folder.written("long.xml", "<Transform From=\"" + word + "\" To=\"Probe\"/>")),
                 InvalidInput);
    std::string many;
    for (int n = 0; n < 300'000; ++n) many += "<Transform ";
    EXPECT_THROW(read_calibration(folder.written("many.xml", many)), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::imaging
