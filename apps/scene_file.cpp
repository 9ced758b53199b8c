#include "apps/scene_file.hpp"

#include "apps/parameters.hpp"
#include "apps/scene_parts.hpp"
#include "core/file_message.hpp"
#include "imaging/labels.hpp"

#include <algorithm>

namespace tissuewarp::apps {

using namespace simulation;

namespace {

/// Labels that the geometry has.
std::vector<int> labels_of(const Geometry& geometry) {
    if (const auto* volume = std::get_if<LabelledVolume>(&geometry)) return imaging::labels_in(volume->labels);
    std::vector<int> labels{1};
    if (const auto* mesh = std::get_if<meshing::TetMesh>(&geometry))
        labels.assign(mesh->labels.begin(), mesh->labels.end());
    if (const auto* painted = std::get_if<ShapeGeometry>(&geometry)) {
        labels.clear();
        for (const Shape& shape : painted->shapes) labels.push_back(shape.label);
    }
    std::sort(labels.begin(), labels.end());
    labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
    return labels;
}

std::string list(const std::vector<int>& labels) {
    std::string text;
    for (const int label : labels)
        if (label > 0) text += (text.empty() ? "" : ", ") + std::to_string(label);
    return text;
}

void require_names(const Scene& scene, const NameUses& uses) {
    std::vector<std::string> names;
    for (const auto& [name, region] : scene.sets) names.push_back(name);
    for (const auto& [set, place] : uses.sets) {
        if (scene.sets.contains(set)) continue;
        const std::string nearest = nearest_name(set, names);
        throw InvalidInput(place + ": there is no set '" + set + "'" +
                           (nearest.empty() ? "; add [set." + set + "]" : "; did you mean '" + nearest + "'?"));
    }
    for (const auto& [label, place, role] : uses.tissue_labels)
        if (!scene.tissues.contains(label))
            throw InvalidInput(place + ": label " + std::to_string(label) + " " + role +
                               " and has no tissue; add [label." + std::to_string(label) + "]");
}

void require_labels(const Scene& scene, const NameUses& uses) {
    const std::vector<int> present = labels_of(scene.geometry);
    for (const auto& [label, place, role] : uses.volume_labels)
        if (!std::binary_search(present.begin(), present.end(), label))
            throw InvalidInput(place + ": label " + std::to_string(label) + " " + role +
                               " and the geometry has labels " + list(present) + " only" + uses.geometry_notes);
}

void read_probes(TomlReader& file, Scene& scene) {
    for (TomlReader& reader : file.tables("probe")) {
        scene.probes.push_back({reader.required_text("name"), reader.required_vector("at_mm", any_length)});
        reader.finish();
    }
}

Scene read_checked(const toml::table& table, const std::filesystem::path& path, Observer& observer) {
    const std::filesystem::path folder = path.parent_path();
    TomlReader file(table, path, "");
    Scene scene;
    NameUses uses;
    scene.title = file.text("title").value_or(path.stem().string());
    read_tissues(file, folder, scene, uses, observer);
    read_sets(file, scene, uses);
    read_loads(file, scene, uses);
    read_neighbours(file, folder, scene, uses, observer);
    read_solve(file, scene);
    read_probes(file, scene);
    (void)file.table("geometry");
    file.finish();
    require_names(scene, uses);
    require_valid(scene);
    read_geometry(file, folder, scene, uses, observer);
    require_labels(scene, uses);
    return scene;
}

}  // namespace

Scene read_scene(const std::filesystem::path& path, Observer& observer) {
    return naming(path, [&] { return read_checked(parse_toml_file(path), path, observer); });
}

Scene scene_of_text(std::string_view text, const std::filesystem::path& folder, Observer& observer) {
    const std::filesystem::path path = folder / "scene";
    return naming(path, [&] { return read_checked(parse_toml(text, path), path, observer); });
}

}  // namespace tissuewarp::apps
