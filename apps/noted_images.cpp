#include "apps/noted_images.hpp"

#include "apps/naming_page.hpp"

namespace tissuewarp::apps {

namespace {

imaging::Volume noted(imaging::ReadResult read, const std::filesystem::path& path, Observer& observer) {
    for (const std::string& note : notes_of(read, path)) observer.note(note);
    return std::move(read.volume);
}

}  // namespace

std::vector<std::string> notes_of(const imaging::ReadResult& read, const std::filesystem::path& path) {
    std::vector<std::string> notes;
    for (const std::string& note : read.notes) notes.push_back("'" + path.string() + "': " + note);
    return notes;
}

imaging::Volume read_noted_volume(const std::filesystem::path& path, Observer& observer) {
    return noted(naming_page(images_page, [&] { return imaging::read_volume_with_notes(path); }), path, observer);
}

imaging::Volume read_noted_labels(const std::filesystem::path& path, Observer& observer) {
    return noted(naming_page(images_page, [&] { return imaging::read_labels_with_notes(path); }), path, observer);
}

}  // namespace tissuewarp::apps
