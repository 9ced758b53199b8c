// Compiled once per instruction set and chosen at run time (Highway).

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apps/cpu_ceilings.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "apps/cpu_ceilings.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::apps {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Twelve chains, none of which waits for another, each towards its fixed point 1. Returns multiply-adds.
double multiply_add_chains(std::size_t rounds, float* result) {
    const hn::ScalableTag<float> d;
    const auto factor = hn::Set(d, 0.75F), rest = hn::Set(d, 0.25F);
    auto a0 = hn::Iota(d, 0.0F), a1 = hn::Add(a0, factor), a2 = hn::Add(a1, factor), a3 = hn::Add(a2, factor);
    auto b0 = hn::Add(a3, factor), b1 = hn::Add(b0, factor), b2 = hn::Add(b1, factor), b3 = hn::Add(b2, factor);
    auto c0 = hn::Add(b3, factor), c1 = hn::Add(c0, factor), c2 = hn::Add(c1, factor), c3 = hn::Add(c2, factor);
    for (std::size_t round = 0; round < rounds; ++round) {
        a0 = hn::MulAdd(a0, factor, rest), a1 = hn::MulAdd(a1, factor, rest), a2 = hn::MulAdd(a2, factor, rest);
        a3 = hn::MulAdd(a3, factor, rest), b0 = hn::MulAdd(b0, factor, rest), b1 = hn::MulAdd(b1, factor, rest);
        b2 = hn::MulAdd(b2, factor, rest), b3 = hn::MulAdd(b3, factor, rest), c0 = hn::MulAdd(c0, factor, rest);
        c1 = hn::MulAdd(c1, factor, rest), c2 = hn::MulAdd(c2, factor, rest), c3 = hn::MulAdd(c3, factor, rest);
    }
    const auto a = hn::Add(hn::Add(a0, a1), hn::Add(a2, a3)), b = hn::Add(hn::Add(b0, b1), hn::Add(b2, b3));
    *result = hn::GetLane(hn::SumOfLanes(d, hn::Add(hn::Add(a, b), hn::Add(hn::Add(c0, c1), hn::Add(c2, c3)))));
    return 12.0 * double(hn::Lanes(d)) * double(rounds);
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::apps
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <vector>

namespace tissuewarp::apps {

HWY_EXPORT(multiply_add_chains);

namespace {

constexpr int runs = 5;

/// Least seconds of `work(thread)` on all threads at once.
template <class Work>
double best_seconds(std::size_t threads, const Work& work) {
    double best = 1e30;
    for (int run = 0; run < runs + 1; ++run) {  // the first only warms up
        const auto begin = std::chrono::steady_clock::now();
        tbb::parallel_for(
            std::size_t{0}, threads, [&](std::size_t thread) { work(thread); }, tbb::static_partitioner());
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        if (run > 0) best = std::min(best, seconds);
    }
    return best;
}

double copy_rate(std::size_t threads) {
    const std::size_t part = (std::size_t{512} << 20) / threads;  // beyond the last-level cache of large servers
    const auto source = std::make_unique_for_overwrite<char[]>(part * threads);
    const auto target = std::make_unique_for_overwrite<char[]>(part * threads);
    best_seconds(threads, [&](std::size_t i) { std::memset(&source[i * part], 1, part); });  // pages near their thread
    const double seconds =
        best_seconds(threads, [&](std::size_t i) { std::memcpy(&target[i * part], &source[i * part], part); });
    return 2.0 * double(part * threads) / seconds;
}

double fma_rate(std::size_t threads) {
    constexpr std::size_t rounds = 4'000'000;  // ten milliseconds
    std::vector<float> results(threads);
    std::vector<double> multiply_adds(threads);
    const auto chains = HWY_DYNAMIC_DISPATCH(multiply_add_chains);
    const double seconds =
        best_seconds(threads, [&](std::size_t i) { multiply_adds[i] = chains(rounds, &results[i]); });
    double sum = 0;
    for (const double each : multiply_adds) sum += each;
    return 2.0 * sum / seconds;
}

}  // namespace

shaders::Ceilings measured_cpu_ceilings() {
    const auto threads = static_cast<std::size_t>(std::max(1, tbb::this_task_arena::max_concurrency()));
    return {copy_rate(threads), fma_rate(threads)};
}

}  // namespace tissuewarp::apps
#endif
