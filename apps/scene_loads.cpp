// [set.<name>] and what holds, moves and loads the tissue.

#include "apps/scene_parts.hpp"

namespace tissuewarp::apps {

using namespace simulation;

namespace {

std::string set_of(TomlReader& reader, NameUses& uses) {
    const std::string set = reader.required_text("set");
    uses.sets.push_back({set, reader.place("set")});
    return set;
}

/// "xz" → x and z.
std::array<bool, 3> axes_of(TomlReader& reader) {
    const std::string text = reader.text("axes").value_or("xyz");
    std::array<bool, 3> axes{false, false, false};
    for (const char c : text) {
        if (c < 'x' || c > 'z') reader.refuse("axes", "'axes' is '" + text + "'; give some of xyz");
        axes[static_cast<std::size_t>(c - 'x')] = true;
    }
    if (text.empty()) reader.refuse("axes", "'axes' is empty; give some of xyz");
    return axes;
}

Side side_of(TomlReader& reader) {
    const std::string text = reader.one_of("side", {"-x", "+x", "-y", "+y", "-z", "+z"}, "");
    Side side;
    side.axis = text[1] - 'x';
    side.upper = text[0] == '+';
    return side;
}

Region region_of(TomlReader& reader, NameUses& uses) {
    Region region;
    region.label = reader.whole("label", 1, 1000000);
    if (region.label) uses.tissue_labels.push_back({*region.label, reader.place("label"), "is named by a set"});
    region.surface_of = reader.whole("surface_of", 0, 1000000);
    if (region.surface_of.value_or(0) > 0)
        uses.tissue_labels.push_back({*region.surface_of, reader.place("surface_of"), "is named by a set"});
    if (const std::vector<int> pair = reader.wholes("interface", 1, 1000000); !pair.empty()) {
        if (pair.size() != 2) reader.refuse("interface", "'interface' must be two labels");
        region.interface = {pair[0], pair[1]};
        for (const int label : pair)
            uses.tissue_labels.push_back({label, reader.place("interface"), "is named by a set"});
    }
    if (const auto box = reader.table("box")) region.box = read_box(*box);
    if (const auto ball = reader.table("ball")) region.ball = read_ball(*ball);
    if (const auto half_space = reader.table("half_space")) region.half_space = read_half_space(*half_space);
    const auto depth = reader.number("depth_mm", positive_length);
    if (reader.has("side")) {
        region.side = side_of(reader);
        region.side->depth_mm = depth.value_or(0.0);
    } else if (depth) {
        reader.refuse("depth_mm", "'depth_mm' is the depth of a 'side'; give that too");
    }
    (void)reader.text("side");
    region.without = reader.texts("without");
    for (const std::string& other : region.without) uses.sets.push_back({other, reader.place("without")});
    reader.finish();
    return region;
}

void read_springs(TomlReader& reader, Scene& scene, NameUses& uses) {
    Springs springs;
    springs.set = set_of(reader, uses);
    springs.per_area = reader.number("stiffness_kpa_per_mm", {1e-9, 1e6, "kPa/mm"}).value_or(0.0);
    springs.total = reader.number("stiffness_n_per_m", {1e-9, 1e9, "N/m"}).value_or(0.0);
    if ((springs.per_area > 0) == (springs.total > 0))
        throw InvalidInput(reader.place() + ": springs take one of 'stiffness_kpa_per_mm' (for each mm2 of the set's " +
                           "surface) and 'stiffness_n_per_m' (of the whole set)");
    springs.along = reader.one_of("along", {"all", "normal"}, "all") == "normal" ? Springs::Along::Normal
                                                                                 : Springs::Along::AllDirections;
    reader.finish();
    scene.springs.push_back(springs);
}

void read_gravity(TomlReader& file, Scene& scene) {
    auto reader = file.table("gravity");
    if (!reader) return;
    Gravity gravity;
    gravity.from = reader->direction("from");
    const auto to = reader->direction("to");
    if (!to && !gravity.from) throw InvalidInput(reader->place() + ": [gravity] lacks 'to', its direction [x, y, z]");
    gravity.to = to ? *to : *gravity.from;
    gravity.magnitude = reader->number("magnitude_mm_s2", {1.0, 1e6, "mm/s2"}).value_or(gravity.magnitude);
    gravity.curve = reader->curve();
    reader->finish();
    scene.gravity = gravity;
}

void read_fluid(TomlReader& file, Scene& scene) {
    auto reader = file.table("fluid");
    if (!reader) return;
    FluidLevel fluid;
    fluid.density = 1e-9 * reader->number("density_kg_m3", {100.0, 20000.0, "kg/m3"}).value_or(1000.0);
    fluid.from = reader->required_number("from_mm", any_length);
    fluid.to = reader->required_number("to_mm", any_length);
    fluid.curve = reader->curve();
    reader->finish();
    if (!scene.gravity || !scene.gravity->from)
        throw InvalidInput(reader->place() +
                           ": a fluid lifts against gravity; give [gravity] with 'from', the direction in the image");
    scene.fluid = fluid;
}

}  // namespace

Box read_box(TomlReader reader) {
    Box box;
    box.lower = reader.required_vector("lower_mm", any_length);
    box.upper = reader.required_vector("upper_mm", any_length);
    reader.finish();
    if ((box.upper - box.lower).minCoeff() < 0)
        reader.refuse("upper_mm", "'upper_mm' is below 'lower_mm' along an axis");
    return box;
}

Ball read_ball(TomlReader reader) {
    Ball ball;
    ball.centre = reader.required_vector("centre_mm", any_length);
    ball.radius = reader.required_number("radius_mm", positive_length);
    reader.finish();
    return ball;
}

HalfSpace read_half_space(TomlReader reader) {
    HalfSpace half_space;
    half_space.point = reader.required_vector("point_mm", any_length);
    const auto normal = reader.direction("normal");
    if (!normal) throw InvalidInput(reader.place() + ": a plane lacks 'normal', [x, y, z]");
    half_space.normal = *normal;
    reader.finish();
    return half_space;
}

void read_sets(TomlReader& file, Scene& scene, NameUses& uses) {
    for (auto& [name, reader] : file.named_tables("set")) scene.sets[name] = region_of(reader, uses);
}

void read_loads(TomlReader& file, Scene& scene, NameUses& uses) {
    for (TomlReader& reader : file.tables("fixed")) {
        scene.fixed.push_back({set_of(reader, uses), axes_of(reader)});
        reader.finish();
    }
    for (TomlReader& reader : file.tables("motion")) {
        Motion motion;
        motion.set = set_of(reader, uses);
        motion.axes = axes_of(reader);
        if (!reader.has("displacement_mm") && !reader.has("rotation"))
            throw InvalidInput(reader.place() + ": a motion needs 'displacement_mm', a 'rotation' or both");
        motion.motion = read_rigid_motion(reader);
        motion.curve = reader.curve();
        reader.finish();
        scene.motions.push_back(motion);
    }
    for (TomlReader& reader : file.tables("springs")) read_springs(reader, scene, uses);
    read_gravity(file, scene);
    read_fluid(file, scene);
    for (TomlReader& reader : file.tables("pressure")) {
        Pressure pressure;
        pressure.set = set_of(reader, uses);
        pressure.pressure = reader.required_number("pressure_kpa", {-1e4, 1e4, "kPa"});
        pressure.curve = reader.curve();
        reader.finish();
        scene.pressures.push_back(pressure);
    }
    for (TomlReader& reader : file.tables("traction")) {
        Traction traction;
        traction.set = set_of(reader, uses);
        traction.traction = reader.required_vector("traction_kpa", {-1e4, 1e4, "kPa"});
        traction.curve = reader.curve();
        reader.finish();
        scene.tractions.push_back(traction);
    }
    for (TomlReader& reader : file.tables("membrane")) {
        MembraneOn membrane;
        membrane.set = set_of(reader, uses);
        membrane.shear_modulus = reader.required_number("shear_modulus_kpa", {1e-3, 1e7, "kPa"});
        membrane.thickness = reader.required_number("thickness_mm", {1e-3, 100.0, "mm"});
        reader.finish();
        scene.membranes.push_back(membrane);
    }
    for (TomlReader& reader : file.tables("resection")) {
        Resection resection;
        resection.set = set_of(reader, uses);
        resection.time = reader.required_number("time_s", {0.0, 1e6, "s"});
        reader.finish();
        scene.resections.push_back(resection);
    }
}

}  // namespace tissuewarp::apps
