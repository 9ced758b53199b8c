#pragma once
/// Where this user keeps what was measured on this machine.

#include <filesystem>
#include <string>

namespace tissuewarp {

/// `name` in the folder that the environment variable TISSUEWARP_CACHE names, else in $XDG_CACHE_HOME/tissuewarp, else
/// in ~/.cache/tissuewarp. Empty where there is none of the three.
std::filesystem::path user_cache_file(const std::string& name);

}  // namespace tissuewarp
