// [[contact]] and [[sliding]]: what the tissue touches.

#include "apps/scene_parts.hpp"
#include "meshing/mesh_io.hpp"
#include "registration/io/extent.hpp"

#include <numbers>

namespace tissuewarp::apps {

using namespace simulation;

namespace {

meshing::SurfaceMesh obstacle_surface(const std::filesystem::path& path, Observer& observer) {
    meshing::SurfaceMesh surface = meshing::read_surface(path, observer).mesh;
    registration::detail::require_millimetres(surface.nodes, "'" + path.string() + "': the surface is");
    return surface;
}

Body body_of(TomlReader& reader, const std::filesystem::path& folder, NameUses& uses, Observer& observer) {
    std::vector<Body> bodies;
    if (const auto plane = reader.table("plane")) bodies.emplace_back(read_half_space(*plane));
    if (const auto ball = reader.table("ball")) bodies.emplace_back(read_ball(*ball));
    if (const auto surface = reader.text("surface")) bodies.emplace_back(obstacle_surface(folder / *surface, observer));
    if (const auto label = reader.whole("label", 1, 1000000)) {
        bodies.emplace_back(ObstacleLabel{*label});
        uses.volume_labels.push_back({*label, reader.place("label"), "is a body in contact"});
    }
    if (const std::vector<int> labels = reader.wholes("outside_of", 1, 1000000); !labels.empty()) {
        bodies.emplace_back(OutsideOfLabels{labels});
        for (const int label : labels)
            uses.volume_labels.push_back({label, reader.place("outside_of"), "is within a body in contact"});
    }
    if (bodies.size() != 1)
        throw InvalidInput(reader.place() +
                           ": a contact takes one of 'plane', 'ball', 'surface', 'label' and 'outside_of'");
    return bodies.front();
}

void read_sides(TomlReader& reader, Sliding& sliding, NameUses& uses) {
    const std::vector<int> labels = reader.wholes("labels", 1, 1000000);
    const std::vector<std::string> sets = reader.texts("sets");
    if (labels.empty() == sets.empty())
        throw InvalidInput(reader.place() +
                           ": a sliding interface lies between two 'labels', [a, b], or two 'sets' of tissue");
    if (!sets.empty()) {
        if (sets.size() != 2) reader.refuse("sets", "a sliding interface lies between two 'sets', [\"a\", \"b\"]");
        sliding.sets = {sets[0], sets[1]};
        for (const std::string& set : sets) uses.sets.push_back({set, reader.place("sets")});
        return;
    }
    if (labels.size() != 2) reader.refuse("labels", "a sliding interface lies between two 'labels', [a, b]");
    sliding.labels = {labels[0], labels[1]};
    for (const int label : labels) uses.tissue_labels.push_back({label, reader.place("labels"), "slides"});
}

}  // namespace

RigidMotion read_rigid_motion(TomlReader& reader) {
    RigidMotion motion;
    motion.displacement = reader.vector("displacement_mm", any_length).value_or(Eigen::Vector3d::Zero());
    auto rotation = reader.table("rotation");
    if (!rotation) return motion;
    constexpr double most_degrees = 36000;
    const auto point = rotation->vector("point_mm", any_length), axis = rotation->direction("axis");
    const auto degrees = rotation->number("degrees", {-most_degrees, most_degrees, "degrees"});
    rotation->finish();  // a misspelt key is named before what is missing
    if (!point || !axis || !degrees)
        throw InvalidInput(rotation->place() + ": a rotation needs 'point_mm' and 'axis', [x, y, z], and 'degrees'");
    motion.point = *point;
    motion.turn = *degrees * std::numbers::pi / 180 * *axis;
    return motion;
}

void read_neighbours(TomlReader& file, const std::filesystem::path& folder, Scene& scene, NameUses& uses,
                     Observer& observer) {
    for (TomlReader& reader : file.tables("contact")) {
        Contact contact;
        contact.set = reader.text("set").value_or("");
        if (!contact.set.empty()) uses.sets.push_back({contact.set, reader.place("set")});
        contact.gap = reader.number("gap_mm", {0.0, 1000.0, "mm"}).value_or(0.0);
        contact.friction = reader.number("friction", {0.0, 10.0}).value_or(0.0);
        contact.motion = read_rigid_motion(reader);
        contact.curve = reader.curve();
        contact.body = body_of(reader, folder, uses, observer);
        reader.finish();
        scene.contacts.push_back(contact);
    }
    for (TomlReader& reader : file.tables("sliding")) {
        Sliding sliding;
        read_sides(reader, sliding, uses);
        const std::string opening = reader.one_of("opening", {"held", "free"}, "held");
        sliding.opening = opening == "free" ? Sliding::Opening::Free : Sliding::Opening::Held;
        sliding.per_area = reader.number("stiffness_kpa_per_mm", {1e-6, 1e6, "kPa/mm"}).value_or(sliding.per_area);
        sliding.except = reader.text("except").value_or("");
        if (!sliding.except.empty()) uses.sets.push_back({sliding.except, reader.place("except")});
        reader.finish();
        scene.sliding.push_back(sliding);
    }
}

}  // namespace tissuewarp::apps
