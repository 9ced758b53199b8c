#pragma once
/// How many cores a run may use.

#include <functional>

namespace tissuewarp::apps {

/// Calls `work` with TBB, OpenCV and OpenBLAS limited to `threads` cores; 0 leaves their choice, all cores.
void with_threads(int threads, const std::function<void()>& work);

}  // namespace tissuewarp::apps
