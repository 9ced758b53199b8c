#pragma once
/// How many cores a run may use.

#include <memory>

namespace tissuewarp::apps {

/// Limits TBB, OpenCV and OpenBLAS for as long as it lives; 0 leaves their choice, all cores. Throws InvalidInput below
/// 0.
class ThreadLimit {
public:
    explicit ThreadLimit(int threads);
    ~ThreadLimit();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::apps
