#include "core/user_cache.hpp"

#include <cstdlib>

namespace tissuewarp {

namespace fs = std::filesystem;

fs::path user_cache_file(const std::string& name) {
    const auto variable = [](const char* of) {
        const char* value = std::getenv(of);
        return fs::path(value == nullptr ? "" : value);
    };
    if (const fs::path folder = variable("TISSUEWARP_CACHE"); !folder.empty()) return folder / name;
    // The XDG Base Directory Specification has relative paths ignored.
    if (const fs::path caches = variable("XDG_CACHE_HOME"); caches.is_absolute()) return caches / "tissuewarp" / name;
    if (const fs::path home = variable("HOME"); !home.empty()) return home / ".cache" / "tissuewarp" / name;
    return {};
}

}  // namespace tissuewarp
