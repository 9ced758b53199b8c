#pragma once
/// Refusals that a page of the documents helps with.

#include "core/errors.hpp"

#include <string>

namespace tissuewarp::apps {

/// What `read` returns. Its InvalidInput goes on with the page's path, in the sources and in /usr/share/doc/tissuewarp.
template <class Read>
auto naming_page(const char* page, Read&& read) {
    try {
        return read();
    } catch (const InvalidInput& refusal) {
        const std::string message = refusal.what();
        throw InvalidInput(message.find("docs/") == std::string::npos ? message + " (" + page + ")" : message);
    }
}

inline constexpr const char* images_page = "docs/manual/images.md";
inline constexpr const char* points_page = "docs/manual/points.md";
inline constexpr const char* scenes_page = "docs/manual/scene-file.md";

}  // namespace tissuewarp::apps
