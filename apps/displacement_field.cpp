#include "apps/displacement_field.hpp"

#include "apps/inputs.hpp"
#include "apps/noted_images.hpp"
#include "core/errors.hpp"
#include "registration/io/displacements.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {
namespace fs = std::filesystem;
using imaging::Volume;

Volume read_displacement(const fs::path& path, Observer& observer) {
    const Volume read = read_noted_volume(path, observer);
    if (read.channels() != 3)
        throw InvalidInput(
            fmt::format("'{}' has {} components; give a displacement field of three", path.string(), read.channels()));
    require_millimetres(read.geometry, path);
    Volume field = read.as(CV_32F);
    registration::require_displacements(field, path);
    return field;
}

}  // namespace tissuewarp::apps
