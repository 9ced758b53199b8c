#pragma once
/// Keeps libraries from writing to standard error where they cannot be told otherwise.

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>

namespace tissuewarp::apps {

/// While this lives, standard error leads nowhere: niftilib reports a full disk there, beside the exception that the
/// user sees as one line. Of the whole process: for use by one thread at a time.
class SilencedStandardError {
public:
    SilencedStandardError() : kept_(dup(STDERR_FILENO)) {
        std::fflush(stderr);
        const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
        if (kept_ >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
        if (nowhere >= 0) close(nowhere);
    }
    ~SilencedStandardError() {
        std::fflush(stderr);
        if (kept_ < 0) return;
        dup2(kept_, STDERR_FILENO);
        close(kept_);
    }
    SilencedStandardError(const SilencedStandardError&) = delete;
    SilencedStandardError& operator=(const SilencedStandardError&) = delete;

private:
    int kept_;
};

}  // namespace tissuewarp::apps
