// tissuewarp convert: a transform or displacement field of one program as a file for another.

#include "apps/displacement_field.hpp"
#include "apps/noted_images.hpp"
#include "apps/output_folder.hpp"
#include "apps/output_names.hpp"
#include "apps/progress.hpp"
#include "apps/silenced_stderr.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"
#include "registration/io/point_map_field.hpp"
#include "registration/io/transform_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;
using imaging::FieldType;
using imaging::Geometry;
using registration::PointMap;

enum class Target { Composite, Linear, Field };

std::string lower_case_name(const fs::path& path) {
    std::string name = path.filename().string();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    return name;
}

Target target_of(const ConvertOptions& options) {
    const std::string name = lower_case_name(options.output);
    const auto ends_with_one_of = [&](std::initializer_list<const char*> extensions) {
        return std::any_of(extensions.begin(), extensions.end(), [&](const char* e) { return name.ends_with(e); });
    };
    if (options.matrix && !name.ends_with(".txt"))
        throw InvalidInput(fmt::format("--matrix writes text, and '{}' names none; give a name that ends in .txt",
                                       options.output.string()));
    if (name.ends_with(".h5")) return Target::Composite;
    if (ends_with_one_of({".tfm", ".txt"})) return Target::Linear;
    if (ends_with_one_of({".nii", ".nii.gz", ".nrrd", ".mha"})) return Target::Field;
    throw InvalidInput(
        fmt::format("cannot write '{}': the extension names no transform; use .h5 (ITK, any transform), .tfm or .txt "
                    "(ITK, linear ones), or .nii.gz, .nii, .nrrd or .mha (displacement field)",
                    options.output.string()));
}

PointMap read_map(const fs::path& path, Observer& observer) {
    if (path.extension() == ".h5" || path.extension() == ".mat" || !imaging::is_image(path))
        return registration::read_point_map(path);
    PointMap map;
    map.field = read_displacement(path, observer);
    map.type = imaging::stated_field_type(path).value_or(FieldType::Resampling);
    return map;
}

std::optional<FieldType> type_named(const std::string& name) {
    if (name.empty()) return std::nullopt;
    return name == name_of(FieldType::Modeling) ? FieldType::Modeling : FieldType::Resampling;
}

/// What the input maps: as the command line says, or the file, or ITK's convention.
FieldType input_type(const ConvertOptions& options, const PointMap& map) {
    const auto said = type_named(options.from);
    const auto stated = imaging::stated_field_type(options.input);
    if (said && stated && *said != *stated)
        throw InvalidInput(fmt::format("--from {} contradicts '{}', which says '{}'; leave --from out", options.from,
                                       options.input.string(), name_of(*stated)));
    if (!said && !stated && options.input.filename().string().starts_with(moving_to_fixed_name))
        throw InvalidInput(fmt::format(
            "'{}' has the name of this program's field from moving points to fixed ones; say --from modeling, or "
            "--from resampling where it is not",
            options.input.string()));
    return said.value_or(map.type);
}

/// NRRD can say what it maps; of all else ITK's convention is expected.
FieldType output_type(const ConvertOptions& options, FieldType input) {
    const bool tells = lower_case_name(options.output).ends_with(".nrrd");
    return type_named(options.to).value_or(tells ? input : FieldType::Resampling);
}

std::optional<Geometry> reference_grid(const ConvertOptions& options, Observer& observer) {
    if (options.reference.empty()) return std::nullopt;
    return read_noted_volume(options.reference, observer).geometry;
}

PointMap inverse(const PointMap& map, const std::optional<Geometry>& grid, FieldType output) {
    if (!map.field) return registration::inverse_of_linear(map);
    if (grid) return registration::inverse_on(map, *grid);
    throw InvalidInput(
        fmt::format("its displacement field has to be inverted, which needs a grid; give the {} image as "
                    "--reference",
                    output == FieldType::Resampling ? "fixed" : "moving"));
}

/// The linear map that it is. Throws InvalidInput where it is none.
PointMap linear(const PointMap& map) {
    constexpr double most_off_mm = 0.01;  // what fields are exact to
    const registration::NearestLinear nearest = registration::nearest_linear(map);
    PointMap result;
    result.after = nearest.map;
    if (nearest.furthest_mm <= most_off_mm) return result;
    throw InvalidInput(fmt::format(
        "its displacement field is up to {:.2f} mm from any linear transform, and the output holds nothing else; write "
        ".h5, .nii.gz or .nrrd",
        nearest.furthest_mm));
}

imaging::Volume field(const PointMap& map, const std::optional<Geometry>& reference) {
    const auto grid = reference ? reference : registration::own_grid(map);
    if (!grid)
        throw InvalidInput(
            "it tells no grid for a displacement field; give the image whose grid it shall have as --reference");
    return registration::displacement_on(map, *grid);
}

void write(const PointMap& map, FieldType type, const ConvertOptions& options,
           const std::optional<Geometry>& reference) {
    const SilencedStandardError silenced;
    if (target_of(options) == Target::Field) {
        const imaging::Volume displacement = field(map, reference);
        write_displacement_field(displacement, options.output, type);
    } else if (options.matrix) {
        registration::write_matrix(map.after * map.before, options.output);
    } else {
        registration::write_itk_transform(map, options.output);
    }
}

const char* direction_text(FieldType type) {
    return type == FieldType::Resampling ? "fixed to moving points (resampling)" : "moving to fixed points (modeling)";
}

}  // namespace

void run_convert(const ConvertOptions& options) {
    ProgressLine progress(options.common);
    target_of(options);
    require_could_write_file(options.output);
    progress.begin("converting", 0.0, 1.0);
    PointMap map = read_map(options.input, progress);
    const FieldType from = input_type(options, map), to = output_type(options, from);
    const std::optional<Geometry> reference = reference_grid(options, progress);
    try {
        if (target_of(options) == Target::Linear) map = linear(map);
        if (from != to) map = inverse(map, reference, to);
        write(map, to, options, reference);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(fmt::format("cannot convert '{}' into '{}': {}", options.input.string(),
                                       options.output.string(), problem.what()));
    }
    progress.clear();
    if (options.common.quiet) return;
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
    fmt::print("{} maps {}{}\n", options.output.string(), direction_text(to),
               from == to ? "" : ", the inverse of the input");
}

}  // namespace tissuewarp::apps
