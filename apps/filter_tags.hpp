#pragma once
/// Progress as command-line modules of 3D Slicer tell it.

#include <chrono>
#include <string>

namespace tissuewarp::apps {

/// Writes `<filter-start>`, `<filter-progress>` (of the whole run) and `<filter-end>` to standard output, a filter for
/// each stage. Progress that is less than a percent further is not written.
class FilterTags {
public:
    FilterTags() = default;
    ~FilterTags() { end(); }
    FilterTags(const FilterTags&) = delete;
    FilterTags& operator=(const FilterTags&) = delete;

    void begin(const std::string& stage);
    void progress(double fraction);

private:
    void end();

    std::string stage_;  // empty: none is open
    int percent_ = -1;
    std::chrono::steady_clock::time_point start_;
};

}  // namespace tissuewarp::apps
