/// Devices: these tests run on whatever EGL offers, Mesa's software rasteriser at least.
#include "shaders/device.hpp"
#include "core/errors.hpp"
#include "shaders/buffer.hpp"
#include "shaders/timer.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

namespace tissuewarp::shaders {
namespace {

TEST(Devices, ListsAtLeastOneUsableDevice) {
    const std::vector<DeviceInfo> devices = list_devices();
    ASSERT_FALSE(devices.empty());
    int usable = 0;
    for (std::size_t i = 0; i < devices.size(); ++i) {
        EXPECT_EQ(devices[i].index, static_cast<int>(i));
        EXPECT_FALSE(devices[i].name.empty());
        if (devices[i].problem.empty()) ++usable;
    }
    EXPECT_GE(usable, 1);
}

TEST(Devices, DefaultIsHardwareWheneverThereIsAny) {
    const std::vector<DeviceInfo> devices = list_devices();
    bool any_hardware = false;
    for (const DeviceInfo& device : devices) any_hardware |= device.hardware && device.problem.empty();
    EXPECT_EQ(Device().hardware(), any_hardware);
}

TEST(Devices, OffersWhatOpenGL45Guarantees) {
    const Device device;
    EXPECT_TRUE(device.version().starts_with("4.") && device.version() >= "4.5") << device.version();
    EXPECT_FALSE(device.renderer().empty());
    const DeviceLimits& limits = device.limits();
    EXPECT_GE(limits.shared_memory_bytes, 32768U);
    EXPECT_GE(limits.storage_buffer_bytes, std::size_t{1} << 24U);
    EXPECT_GE(limits.storage_blocks, 8);
    EXPECT_GE(limits.workgroup_invocations, 1024);
    EXPECT_GE(limits.workgroup_count[0], 65535);
    // Unknown, or what some device has; llvmpipe has none.
    EXPECT_GE(limits.multiprocessors, 0);
    EXPECT_LT(limits.multiprocessors, 10000);
}

TEST(Devices, RefusesAnIndexThatDoesNotExistAndSaysHowManyThereAre) {
    try {
        const Device device(1000);
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("1000"));
        EXPECT_THAT(error.what(), ::testing::HasSubstr("EGL has " + std::to_string(list_devices().size())));
    }
}

TEST(Devices, ContextsNestAndGiveBackWhatWasCurrent) {
    const Device first;
    const Device second;
    Buffer<int> a(first, 1, "a");
    Buffer<int> b(second, 1, "b");
    const CurrentContext outer = first.make_current();
    a.upload(std::vector<int>{1});
    {
        const CurrentContext inner = second.make_current();
        b.upload(std::vector<int>{2});
        EXPECT_EQ(b.download()[0], 2);
    }
    EXPECT_EQ(a.download()[0], 1);
}

TEST(Devices, AContextMovesBetweenThreads) {
    const Device device;
    Buffer<int> values(device, std::vector<int>{5, 6}, "values");
    std::vector<int> seen;
    std::thread([&] {
        const CurrentContext current = device.make_current();
        seen = values.download();
    }).join();
    EXPECT_EQ(seen, (std::vector<int>{5, 6}));
}

TEST(Devices, AContextHeldByAnotherThreadIsRefused) {
    const Device device;
    const CurrentContext held = device.make_current();
    bool refused = false;
    std::thread([&] {
        try {
            const CurrentContext current = device.make_current();
        } catch (const GpuUnavailable&) {
            refused = true;
        }
    }).join();
    EXPECT_TRUE(refused);
}

TEST(Devices, ATimerCountsTheDevicesTime) {
    const Device device;
    GpuTimer timer(device);
    Buffer<float> a(device, 1 << 20, "a");
    Buffer<float> b(device, 1 << 20, "b");
    const CurrentContext current = device.make_current();
    finish();
    const auto begin = std::chrono::steady_clock::now();
    timer.start();
    for (int i = 0; i < 10; ++i) a.copy_from(b, b.bytes());
    timer.stop();
    const double device_seconds = timer.seconds();
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
    // Less than what passed here, up to the coarseness of the device's clock.
    EXPECT_GT(device_seconds, 0.0);
    EXPECT_LE(device_seconds, wall.count() + 1e-4);
}

}  // namespace
}  // namespace tissuewarp::shaders
