#include "apps/versions.hpp"

#include "apps/blas.hpp"

#include <sys/resource.h>

#include <tbb/version.h>
#include <Eigen/Core>
#include <opencv2/core/version.hpp>

#include <ctime>

namespace tissuewarp::apps {

std::string program_version() {
    return TISSUEWARP_VERSION;
}

std::map<std::string, std::string> versions() {
    const auto dotted = [](int a, int b, int c) {
        return std::to_string(a) + "." + std::to_string(b) + "." + std::to_string(c);
    };
    return {{"tissuewarp", TISSUEWARP_VERSION},
            {"compiler", __VERSION__},
            {"BLAS", blas_name()},
            {"Eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
            {"OpenCV", CV_VERSION},
            {"oneTBB", TBB_VERSION_STRING},
            {"ITK", TISSUEWARP_ITK_VERSION},
            {"CGAL", TISSUEWARP_CGAL_VERSION}};
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm fields{};
    gmtime_r(&now, &fields);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &fields);
    return text;
}

long long peak_memory_bytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss * 1024LL;  // Linux counts kilobytes
}

}  // namespace tissuewarp::apps
