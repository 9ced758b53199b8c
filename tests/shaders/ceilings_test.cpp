/// The kernels that measure a device's ceilings do the work that they are timed for.
#include "shaders/ceilings.hpp"
#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>

namespace tissuewarp::shaders {
namespace {

class CeilingsTest : public ::testing::Test {
protected:
    Device device;
    CurrentContext current = device.make_current();
};

// A copy that leaves out entries moves fewer bytes than are counted; one that runs on spoils what lies behind.
TEST_F(CeilingsTest, TheCopyTakesAllAndNoMore) {
    std::vector<float> values(4 * 1000);
    std::iota(values.begin(), values.end(), 1.0F);
    const Buffer<float> source(device, values, "source"), target(device, values.size(), "target");
    const Program copy(device, compose(copy_bandwidth_program()));
    for (const StorageBlock& block : copy.storage_blocks())
        (block.name == "Source" ? source : target).bind(block.binding);
    copy.set(0, 900U);
    copy.dispatch(1000);
    storage_barrier();
    std::fill(values.begin() + 4 * 900, values.end(), 0.0F);
    EXPECT_EQ(target.download(), values);
}

// After n multiply-adds a chain from x stands at 1 + 0.75ⁿ (x - 1): a loop that is left out or shortened gives another
// sum.
TEST_F(CeilingsTest, AChainTakesEveryMultiplyAdd) {
    constexpr int count = 100;
    const Buffer<float> result(device, count, "results");
    const Program chains(device, compose(fma_rate_program()));
    for (const StorageBlock& block : chains.storage_blocks()) result.bind(block.binding);
    for (const std::uint32_t rounds : {0U, 1U, 2U}) {
        chains.set(0, static_cast<std::uint32_t>(count));
        chains.set(1, rounds);
        chains.dispatch(count);
        storage_barrier();
        const std::vector<float> sums = result.download();
        const double left = std::pow(0.75, rounds * fma_per_round / 8.0);
        for (int i = 0; i < count; ++i)
            EXPECT_NEAR(sums[static_cast<std::size_t>(i)], 8 + left * (8.0 * i + 28 - 8), 1e-5 * (8 + 8 * i)) << rounds;
    }
}

// Units: a rate that is off by a factor of a thousand is no rate of any device of OpenGL 4.5. A software rasteriser
// under sanitizers on a busy machine has been seen to copy 9e7 bytes a second.
TEST_F(CeilingsTest, RatesAreThoseOfSomeDevice) {
    const Ceilings ceilings = measured_ceilings(device, 0.0);
    EXPECT_GT(ceilings.copy_bytes_per_second, 1e7);
    EXPECT_LT(ceilings.copy_bytes_per_second, 1e14);
    EXPECT_GT(ceilings.fma_flops_per_second, 1e6);
    EXPECT_LT(ceilings.fma_flops_per_second, 1e15);
}

}  // namespace
}  // namespace tissuewarp::shaders
