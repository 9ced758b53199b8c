#include "tled/detail/single_blas_thread.hpp"

#include <dlfcn.h>

#include <mutex>

namespace tissuewarp::tled::detail {

namespace {

std::mutex guard;
int alive = 0, threads_before = 1;

void set_threads(int count) {
    static const auto set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"));
    if (set) set(count);
}

int threads() {
    static const auto get = reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "openblas_get_num_threads"));
    return get ? get() : 1;
}

}  // namespace

SingleBlasThread::SingleBlasThread() {
    const std::lock_guard lock(guard);
    if (alive++ > 0) return;
    threads_before = threads();
    set_threads(1);
}

SingleBlasThread::~SingleBlasThread() {
    const std::lock_guard lock(guard);
    if (--alive == 0) set_threads(threads_before);
}

}  // namespace tissuewarp::tled::detail
