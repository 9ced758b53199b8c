#include "shaders/ceilings.hpp"

#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>

namespace tissuewarp::shaders {
namespace {

using Clock = std::chrono::steady_clock;
using Float4 = std::array<float, 4>;

constexpr int runs = 5;
constexpr double least_seconds = 0.02;  ///< of a run: far above what one wait for the device takes

double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Runs the work more and more often until a run takes long enough, then returns the least seconds of one time. By the
/// host's clock: software rasterisers give no times of compute programs.
template <class Work>
double best_seconds(double warm_up_seconds, const Work& work) {
    const auto seconds_of = [&](int times) {
        finish();
        const auto begin = Clock::now();
        for (int i = 0; i < times; ++i) work();
        finish();
        return seconds_since(begin);
    };
    const auto begin = Clock::now();
    int times = 1;
    while (seconds_of(times) < least_seconds) times *= 2;
    while (seconds_since(begin) < warm_up_seconds) seconds_of(times);
    double best = std::numeric_limits<double>::max();
    for (int run = 0; run < runs; ++run) best = std::min(best, seconds_of(times) / times);
    return best;
}

double copy_rate(const Device& device, double warm_up_seconds) {
    // Ten times the second-level cache of a large GPU; a software rasteriser's blocks end at 128 MiB.
    const std::size_t wanted = device.hardware() ? std::size_t{512} << 20 : std::size_t{64} << 20;
    const std::size_t count = std::min(wanted, device.limits().storage_buffer_bytes) / sizeof(Float4);
    const Buffer<Float4> source(device, count, "source of a copy"), target(device, count, "target of a copy");
    const Program copy(device, compose(copy_bandwidth_program()));
    for (const StorageBlock& block : copy.storage_blocks())
        (block.name == "Source" ? source : target).bind(block.binding);
    copy.set(0, static_cast<std::uint32_t>(count));
    const double seconds = best_seconds(warm_up_seconds, [&] {
        copy.dispatch(count);
        storage_barrier();
    });
    return 2.0 * double(count * sizeof(Float4)) / seconds;
}

double fma_rate(const Device& device, double warm_up_seconds) {
    const std::size_t invocations = device.hardware() ? std::size_t{1} << 20 : std::size_t{1} << 14;
    constexpr std::uint32_t rounds = 64;
    const Buffer<float> result(device, invocations, "results of multiply-adds");
    const Program chains(device, compose(fma_rate_program()));
    for (const StorageBlock& block : chains.storage_blocks()) result.bind(block.binding);
    chains.set(0, static_cast<std::uint32_t>(invocations));
    chains.set(1, rounds);
    const double seconds = best_seconds(warm_up_seconds, [&] {
        chains.dispatch(invocations);
        storage_barrier();
    });
    return 2.0 * fma_per_round * rounds * double(invocations) / seconds;
}

}  // namespace

Ceilings measured_ceilings(const Device& device, double warm_up_seconds) {
    const CurrentContext current = device.make_current();
    const Ceilings ceilings{copy_rate(device, warm_up_seconds), fma_rate(device, warm_up_seconds)};
    check_errors("ceilings of the device");
    return ceilings;
}

}  // namespace tissuewarp::shaders
