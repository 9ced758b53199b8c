#include "apps/threads.hpp"

#include <dlfcn.h>

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <opencv2/core/utility.hpp>

#include <algorithm>
#include <atomic>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

namespace tissuewarp::apps {

namespace {

/// Threads that live at one time, as those of TBB, OpenMP and OpenCV will.
void require_threads(int count) {
    std::atomic<bool> done{false};
    std::vector<std::thread> made;
    std::string problem;
    try {
        while (static_cast<int>(made.size()) < count) made.emplace_back([&] { done.wait(false); });
    } catch (const std::system_error& failure) {
        problem = failure.code().message();
    }
    done = true;
    done.notify_all();
    for (std::thread& thread : made) thread.join();
    if (!problem.empty())
        throw TooFewThreads(std::to_string(count) + " threads are needed, " + std::to_string(made.size()) +
                            " can be made (" + problem +
                            "); raise the limit on processes (ulimit -u) or give fewer --threads");
}

}  // namespace

int usable_threads(int asked) {
    return std::min(asked, tbb::info::default_concurrency());
}

void with_threads(int threads, const std::function<void()>& work) {
    require_threads(2 * (threads > 0 ? threads : tbb::info::default_concurrency()) + 2);
    if (threads == 0) return work();
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    cv::setNumThreads(threads);
    // The BLAS is whichever the system's alternative is; OpenBLAS alone has threads of its own.
    if (const auto set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(threads);
    tbb::task_arena(threads).execute(work);  // so that work which asks for the concurrency hears of the limit
}

}  // namespace tissuewarp::apps
