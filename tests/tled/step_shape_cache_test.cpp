/// Measured shapes of GPU steps in their file, and which of them a mesh takes.
#include "tled/step_shape_cache.hpp"
#include "core/errors.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

namespace tissuewarp::tled {
namespace {

namespace fs = std::filesystem;

const StepDevice device{"Some GPU", "4.6.0 Vendor 1.2", 10, true};

MeasuredStepShape measured(int tetrahedra, const GpuStepShape& shape, Element element = Element::T4) {
    return {device.name, device.driver, element, tetrahedra, shape, 1.25e-5};
}

class StepShapeFile : public ::testing::Test {
protected:
    void TearDown() override { fs::remove_all(folder); }

    StepShapeCache read(const std::string& text) {
        fs::create_directories(folder);
        std::ofstream(path, std::ios::binary) << text;
        return read_step_shape_cache(path);
    }

    fs::path folder = fs::temp_directory_path() / ("step-shapes-" + std::to_string(::getpid()));
    fs::path path = folder / "gpu_step_shapes.tsv";
};

const std::string good_line = "Some GPU\t4.6.0 Vendor 1.2\tt4\t6000\t200\t2\t320\t20\t1.25e-05\n";

// A column in another's place, a device's name that breaks a line, an element that is lost.
TEST_F(StepShapeFile, GivesBackWhatWasWritten) {
    StepShapeCache cache;
    keep(cache, measured(6000, {200, 2, 320, 20}));
    keep(cache, measured(6000, {210, 5, 640, 0}, Element::AveragedPressureT4));
    MeasuredStepShape odd = measured(7, {});
    odd.device = "a\tname\nof two lines";
    keep(cache, odd);
    write_step_shape_cache(cache, folder / "made" / "shapes.tsv");
    const StepShapeCache back = read_step_shape_cache(folder / "made" / "shapes.tsv");
    EXPECT_EQ(back.skipped, 0);
    ASSERT_EQ(back.shapes.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(back.shapes[i].device, cache.shapes[i].device);
        EXPECT_EQ(back.shapes[i].driver, device.driver);
        EXPECT_EQ(back.shapes[i].element, cache.shapes[i].element);
        EXPECT_EQ(back.shapes[i].tetrahedra, cache.shapes[i].tetrahedra);
        EXPECT_EQ(back.shapes[i].shape, cache.shapes[i].shape);
        EXPECT_DOUBLE_EQ(back.shapes[i].seconds_per_step, 1.25e-5);
    }
    EXPECT_EQ(back.shapes[2].device, "a name of two lines");
}

// Every tuning would leave one line more, and the oldest would win.
TEST_F(StepShapeFile, ANewMeasurementReplacesTheOldOne) {
    StepShapeCache cache;
    keep(cache, measured(6000, {200, 2, 320, 20}));
    keep(cache, measured(6001, {200, 2, 320, 20}));
    keep(cache, measured(6000, {100, 1, 128, 0}));
    ASSERT_EQ(cache.shapes.size(), 2U);
    EXPECT_EQ(best_known_gpu_step_shape(6000, Element::T4, device, cache).shape, (GpuStepShape{100, 1, 128, 0}));
}

// A registration must not fail, nor ask the device for a million invocations, because a file in a cache is damaged.
TEST_F(StepShapeFile, HostileLinesAreSkippedAndCounted) {
    const std::string start = "Some GPU\t4.6.0 Vendor 1.2\tt4\t";
    const std::vector<std::string> hostile{
        "nothing",
        std::string(100000, 'x'),
        std::string("\0\0\0", 3),
        start + "6000\t200\t2\t320\t20\tnan",
        start + "6000\t200\t2\t320\t20\tinf",
        start + "6000\t200\t2\t320\t20\t-1e-5",
        start + "6000\t200\t2\t320\t20\t0",
        start + "6000\t200\t2\t320\t20\t1e-5s",
        start + "6000\t200\t2\t320\t20",           // a column is missing
        start + "6000\t200\t2\t320\t20\t1e-5\t1",  // one too many
        start + "99999999999999999999\t200\t2\t320\t20\t1e-5",
        start + "0\t200\t2\t320\t20\t1e-5",
        start + "6000\t1\t2\t320\t20\t1e-5",  // patches of one tetrahedron
        start + "6000\t-200\t2\t320\t20\t1e-5",
        start + "6000\t2000000000\t2\t320\t20\t1e-5",
        start + "6000\t200\t6\t320\t20\t1e-5",  // a fan that does not fit
        start + "6000\t200\t0\t320\t20\t1e-5",
        start + "6000\t200\t2\t100000\t20\t1e-5",  // more invocations than OpenGL grants
        start + "6000\t200\t2\t0\t20\t1e-5",
        start + "6000\t200\t2\t320\t-1\t1e-5",
        "Some GPU\t4.6.0 Vendor 1.2\thexahedra\t6000\t200\t2\t320\t20\t1e-5",
    };
    for (const std::string& line : hostile) {
        const StepShapeCache cache = read(line + "\n" + good_line);
        EXPECT_EQ(cache.skipped, 1) << line.substr(0, 100);
        EXPECT_EQ(cache.shapes.size(), 1U) << line.substr(0, 100);
    }
    const StepShapeCache endless = read(std::string(20000, '\n') + good_line);
    EXPECT_EQ(endless.skipped, 1);
    EXPECT_TRUE(endless.shapes.empty());
}

TEST_F(StepShapeFile, NoFileIsAnEmptyCache) {
    for (const fs::path& absent : {fs::path(), folder / "absent.tsv", fs::temp_directory_path()}) {
        const StepShapeCache cache = read_step_shape_cache(absent);
        EXPECT_TRUE(cache.shapes.empty());
        EXPECT_EQ(cache.skipped, 0);
    }
}

// Comments and lines without an end, as an editor leaves them.
TEST_F(StepShapeFile, CommentsAndAMissingLastNewlineAreNoFault) {
    const StepShapeCache cache = read("# comment\n\n" + good_line.substr(0, good_line.size() - 1));
    EXPECT_EQ(cache.skipped, 0);
    EXPECT_EQ(cache.shapes.size(), 1U);
}

TEST_F(StepShapeFile, APlaceThatCannotBeWrittenIsSaidWithItsRemedy) {
    read("");  // makes a file where a folder would have to be
    try {
        write_step_shape_cache({}, path / "shapes.tsv");
        FAIL() << "written";
    } catch (const IoError& error) {
        EXPECT_NE(std::string(error.what()).find("TISSUEWARP_CACHE"), std::string::npos) << error.what();
    }
    EXPECT_THROW(write_step_shape_cache({}, {}), IoError);
}

TEST(StepShapeCachePath, FollowsTheEnvironment) {
    ::setenv("TISSUEWARP_CACHE", "/a", 1);
    ::setenv("XDG_CACHE_HOME", "/b", 1);
    ::setenv("HOME", "/c", 1);
    EXPECT_EQ(step_shape_cache_path(), "/a/gpu_step_shapes.tsv");
    ::unsetenv("TISSUEWARP_CACHE");
    EXPECT_EQ(step_shape_cache_path(), "/b/tissuewarp/gpu_step_shapes.tsv");
    ::setenv("XDG_CACHE_HOME", "relative", 1);
    EXPECT_EQ(step_shape_cache_path(), "/c/.cache/tissuewarp/gpu_step_shapes.tsv");
    ::unsetenv("XDG_CACHE_HOME");
    ::unsetenv("HOME");
    EXPECT_EQ(step_shape_cache_path(), fs::path());
}

// Of 6000 and 10000 tetrahedra 7800 is nearer to 10000 in ratio, nearer to 6000 in number.
TEST(BestKnownStepShape, IsTheNearestInRatioWithAsManyPatches) {
    StepShapeCache cache;
    keep(cache, measured(6000, {200, 1, 128, 20}));
    keep(cache, measured(10000, {100, 2, 320, 20}));
    const KnownStepShape same = best_known_gpu_step_shape(6000, Element::T4, device, cache);
    EXPECT_TRUE(same.measured);
    EXPECT_EQ(same.shape, (GpuStepShape{200, 1, 128, 20}));
    EXPECT_EQ(best_known_gpu_step_shape(7800, Element::T4, device, cache).shape, (GpuStepShape{78, 2, 320, 20}));
    EXPECT_EQ(best_known_gpu_step_shape(15000, Element::T4, device, cache).shape, (GpuStepShape{150, 2, 320, 20}));
    EXPECT_EQ(best_known_gpu_step_shape(4000, Element::T4, device, cache).shape, (GpuStepShape{134, 1, 128, 20}));
    for (const int far : {0, 1, 3999, 15001, 2000000000}) {
        const KnownStepShape none = best_known_gpu_step_shape(far, Element::T4, device, cache);
        EXPECT_FALSE(none.measured) << far;
        EXPECT_EQ(none.shape, suggested_gpu_step_shape(far, Element::T4, 10)) << far;
    }
}

TEST(BestKnownStepShape, TwoPassesStayTwoPasses) {
    StepShapeCache cache;
    keep(cache, measured(6000, {}));
    const KnownStepShape known = best_known_gpu_step_shape(5000, Element::T4, device, cache);
    EXPECT_TRUE(known.measured);
    EXPECT_EQ(known.shape, GpuStepShape{});
}

// What was measured on another device, with another driver or element says nothing.
TEST(BestKnownStepShape, IsOfTheSameDeviceDriverAndElement) {
    StepShapeCache cache;
    keep(cache, measured(6000, {200, 1, 128, 20}));
    StepDevice other_device = device, other_driver = device;
    other_device.name = "Another GPU";
    other_driver.driver = "4.6.0 Vendor 1.3";
    EXPECT_TRUE(best_known_gpu_step_shape(6000, Element::T4, device, cache).measured);
    EXPECT_FALSE(best_known_gpu_step_shape(6000, Element::T4, other_device, cache).measured);
    EXPECT_FALSE(best_known_gpu_step_shape(6000, Element::T4, other_driver, cache).measured);
    EXPECT_FALSE(best_known_gpu_step_shape(6000, Element::AveragedPressureT4, device, cache).measured);
}

// Patches that no longer fit into shared memory would be cut by half as many again, which shares them out badly.
TEST(BestKnownStepShape, PatchesThatWouldOutgrowAWorkgroupAreNotTaken) {
    StepShapeCache cache;
    keep(cache, measured(40000, {4000, 5, 640, 10}));
    EXPECT_EQ(best_known_gpu_step_shape(44000, Element::T4, device, cache).shape.patch_tets, 4400);
    EXPECT_FALSE(best_known_gpu_step_shape(46000, Element::T4, device, cache).measured);
    StepShapeCache halves;  // two workgroups on each multiprocessor
    keep(halves, measured(40000, {2000, 5, 320, 20}));
    EXPECT_TRUE(best_known_gpu_step_shape(44000, Element::T4, device, halves).measured);
    EXPECT_FALSE(best_known_gpu_step_shape(46000, Element::T4, device, halves).measured);
}

TEST(StepShapeNames, SayWhatBenchmarksTake) {
    EXPECT_EQ(name_of(GpuStepShape{}), "two passes");
    EXPECT_EQ(name_of(GpuStepShape{2910, 5, 640, 0}), "2910:5:640");
    EXPECT_EQ(name_of(GpuStepShape{2910, 5, 640, 132}), "2910:5:640:132");
}

}  // namespace
}  // namespace tissuewarp::tled
