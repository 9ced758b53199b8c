#include "apps/filter_tags.hpp"

#include <fmt/format.h>

#include <cstdio>

namespace tissuewarp::apps {

void FilterTags::begin(const std::string& stage) {
    end();
    stage_ = stage;
    start_ = std::chrono::steady_clock::now();
    fmt::print("<filter-start>\n<filter-name>{}</filter-name>\n</filter-start>\n", stage_);
    std::fflush(stdout);
}

void FilterTags::progress(double fraction) {
    const int percent = static_cast<int>(100 * fraction);
    if (percent <= percent_) return;
    percent_ = percent;
    fmt::print("<filter-progress>{:.2f}</filter-progress>\n", fraction);
    std::fflush(stdout);
}

void FilterTags::end() {
    if (stage_.empty()) return;
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start_;
    fmt::print("<filter-end>\n<filter-name>{}</filter-name>\n<filter-time>{:.3f}</filter-time>\n</filter-end>\n",
               stage_, taken.count());
    std::fflush(stdout);
    stage_.clear();
}

}  // namespace tissuewarp::apps
