#pragma once
/// Which program and which libraries made a result.

#include <map>
#include <string>

namespace tissuewarp::apps {

std::string program_version();

/// Name → version of tissuewarp, the compiler and the libraries whose versions change results.
std::map<std::string, std::string> versions();

/// Present time in UTC, ISO 8601.
std::string utc_now();

/// Peak resident memory of this process, bytes.
long long peak_memory_bytes();

}  // namespace tissuewarp::apps
