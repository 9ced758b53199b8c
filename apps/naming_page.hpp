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
        throw InvalidInput(std::string(refusal.what()) + " (" + page + ")");
    }
}

inline constexpr const char* images_page = "docs/manual/images.md";
inline constexpr const char* points_page = "docs/manual/points.md";

}  // namespace tissuewarp::apps
