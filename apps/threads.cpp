#include "apps/threads.hpp"

#include <dlfcn.h>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <opencv2/core/utility.hpp>

namespace tissuewarp::apps {

void with_threads(int threads, const std::function<void()>& work) {
    if (threads == 0) return work();
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    cv::setNumThreads(threads);
    // The BLAS is whichever the system's alternative is; OpenBLAS alone has threads of its own.
    if (const auto set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(threads);
    tbb::task_arena(threads).execute(work);  // so that work which asks for the concurrency hears of the limit
}

}  // namespace tissuewarp::apps
