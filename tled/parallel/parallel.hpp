#pragma once
/// The two loops that the solver runs on oneTBB's threads. Bodies write to places of their own, so results do not
/// depend on the number of threads. In them denormal numbers are zero.

#include "tled/parallel/denormals.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <cstddef>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace tissuewarp::tled {

namespace detail {

/// oneTBB starts a loop's bodies after what stands before it and ends the loop after all of them. The library of the
/// system is not built for the thread sanitizer, which cannot see this order and must be told.
class ForkJoin {
public:
#if defined(__SANITIZE_THREAD__)
    ForkJoin() {
        __tsan_release(&fork_);
    }
    void enter() const {
        __tsan_acquire(&fork_);
    }
    void leave() const {
        __tsan_release(&join_);
    }
    void joined() const {
        __tsan_acquire(&join_);
    }

private:
    mutable char fork_ = 0, join_ = 0;
#else
    void enter() const {}
    void leave() const {}
    void joined() const {}
#endif
};

}  // namespace detail

/// body(begin, end) for ranges that cover [first, last): at least `grain` long where they can be, and the same for
/// equal numbers of threads.
template <class Body>
void parallel_ranges(std::size_t first, std::size_t last, std::size_t grain, const Body& body) {
    const detail::ForkJoin order;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(first, last, grain),
        [&](const tbb::blocked_range<std::size_t>& range) {
            order.enter();
            const detail::DenormalsAsZero arithmetic;
            body(range.begin(), range.end());
            order.leave();
        },
        tbb::static_partitioner());
    order.joined();
}

/// body(i) for first ≤ i < last.
template <class Body>
void parallel_for(int first, int last, const Body& body) {
    if (first >= last) return;
    const detail::ForkJoin order;
    tbb::parallel_for(tbb::blocked_range<int>(first, last), [&](const tbb::blocked_range<int>& range) {
        order.enter();
        const detail::DenormalsAsZero arithmetic;
        for (int i = range.begin(); i != range.end(); ++i) body(i);
        order.leave();
    });
    order.joined();
}

}  // namespace tissuewarp::tled
