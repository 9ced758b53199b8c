#pragma once
/// Images for a verb: what their reader had to decide or doubt becomes a note of the verb, with the file's name.

#include "core/observer.hpp"
#include "imaging/image_io.hpp"

#include <string>
#include <vector>

namespace tissuewarp::apps {

/// "'file': note" for each note.
std::vector<std::string> notes_of(const imaging::ReadResult& read, const std::filesystem::path& path);

/// As imaging::read_volume() and imaging::read_labels().
imaging::Volume read_noted_volume(const std::filesystem::path& path, Observer& observer);
imaging::Volume read_noted_labels(const std::filesystem::path& path, Observer& observer);

}  // namespace tissuewarp::apps
