#pragma once
/// Two calls on oneTBB's threads.

#include "tled/parallel/parallel.hpp"

#include <oneapi/tbb/parallel_invoke.h>

namespace tissuewarp::tled {

/// first() and second() at the same time, where there are threads for both. They write to places of their own.
template <class First, class Second>
void parallel_pair(const First& first, const Second& second) {
    const detail::ForkJoin order;
    const auto ordered = [&order](const auto& call) {
        order.enter();
        call();
        order.leave();
    };
    tbb::parallel_invoke([&] { ordered(first); }, [&] { ordered(second); });
    order.joined();
}

}  // namespace tissuewarp::tled
