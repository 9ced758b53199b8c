#pragma once
/// Tasks beside others.

#include <tbb/task_group.h>

namespace tissuewarp::apps {

/// Tasks that end before this does, however it is left. A task group that is left by an exception cancels its own:
/// their loops end half done, and what follows them reads what is not there.
struct FinishedTasks {
    tbb::task_group group;

    FinishedTasks() = default;
    ~FinishedTasks() {
        try {
            group.wait();
        } catch (...) {  // the exception that is under way is the first
        }
    }
    FinishedTasks(const FinishedTasks&) = delete;
    FinishedTasks& operator=(const FinishedTasks&) = delete;
};

}  // namespace tissuewarp::apps
