#include "apps/threads.hpp"

#include "core/errors.hpp"

#include <dlfcn.h>

#include <tbb/global_control.h>
#include <opencv2/core/utility.hpp>

#include <string>

namespace tissuewarp::apps {

struct ThreadLimit::Impl {
    explicit Impl(std::size_t threads) : control(tbb::global_control::max_allowed_parallelism, threads) {}
    tbb::global_control control;  // copies would each end the limit
};

ThreadLimit::ThreadLimit(int threads) {
    if (threads < 0)
        throw InvalidInput("--threads " + std::to_string(threads) + " is below 0; give a count, or 0 for all cores");
    if (threads == 0) return;
    impl_ = std::make_unique<Impl>(static_cast<std::size_t>(threads));
    cv::setNumThreads(threads);
    // The BLAS is whichever the system's alternative is; OpenBLAS alone has threads of its own.
    if (const auto set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(threads);
}

ThreadLimit::~ThreadLimit() = default;

}  // namespace tissuewarp::apps
