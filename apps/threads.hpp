#pragma once
/// How many cores a run may use.

#include "core/errors.hpp"

#include <functional>

namespace tissuewarp::apps {

/// Fewer threads can be made than a run needs.
struct TooFewThreads : Error {
    using Error::Error;
};

/// How many threads a run takes of those asked for, no more than processors; 0, which asks for none, is 0.
int usable_threads(int asked);

/// Calls `work` with TBB, OpenCV and OpenBLAS limited to `threads` cores; 0 leaves their choice, all cores. Throws
/// TooFewThreads before, where the system cannot make the threads: libraries would end the process in their middle.
void with_threads(int threads, const std::function<void()>& work);

}  // namespace tissuewarp::apps
