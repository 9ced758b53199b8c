#include "tled/blas_threads.hpp"

#include <dlfcn.h>

#include <atomic>
#include <mutex>

namespace tissuewarp::tled {

namespace {

std::atomic<bool> may_change = false;
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

int active_levels() {
    static const auto get = reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "omp_get_max_active_levels"));
    return get ? get() : 1;
}

void set_active_levels(int levels) {
    static const auto set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"));
    if (set) set(levels);
}

}  // namespace

void let_solves_take_one_blas_thread(bool allowed) {
    may_change = allowed;
}

namespace detail {

SingleBlasThread::SingleBlasThread() : counts_(may_change) {
    if (!counts_) return;
    const std::lock_guard lock(guard);
    if (alive++ > 0) return;
    threads_before = threads();
    set_threads(1);
}

SingleBlasThread::~SingleBlasThread() {
    if (!counts_) return;
    const std::lock_guard lock(guard);
    if (--alive == 0) set_threads(threads_before);
}

bool SingleBlasThread::holds() const {
    return counts_ || threads() == 1;
}

SerialOpenMp::SerialOpenMp() : levels_before_(active_levels()) {
    set_active_levels(0);
}

SerialOpenMp::~SerialOpenMp() {
    set_active_levels(levels_before_);
}

}  // namespace detail

}  // namespace tissuewarp::tled
