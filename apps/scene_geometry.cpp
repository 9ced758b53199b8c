// [geometry]: a label volume, a mesh, a box or shapes; and [solve].

#include "apps/noted_images.hpp"
#include "apps/scene_parts.hpp"
#include "meshing/mesh_io.hpp"

namespace tissuewarp::apps {

using namespace simulation;

namespace {

const Range edge{0.1, 100.0, "mm"};

BoxGeometry box_geometry(TomlReader reader) {
    BoxGeometry box;
    box.size = reader.required_vector("size_mm", positive_length);
    box.lower = reader.vector("lower_mm", any_length).value_or(Eigen::Vector3d::Zero());
    const std::vector<int> cells = reader.wholes("cells", 1, 1000);
    if (cells.size() != 3) reader.refuse("cells", "'cells' must be three whole numbers, the cells along x, y and z");
    for (std::size_t axis = 0; axis < 3; ++axis) box.cells[axis] = cells[axis];
    reader.finish();
    return box;
}

Shape shape_of(TomlReader& reader) {
    Shape shape;
    shape.label = reader.whole("label", 0, 1000000).value_or(1);
    const auto ellipsoid = reader.table("ellipsoid");
    const auto box = reader.table("box");
    if (ellipsoid.has_value() == box.has_value())
        throw InvalidInput(reader.place() + ": a shape is an 'ellipsoid' or a 'box'; give one of them");
    if (box) {
        shape.solid = read_box(*box);
    } else {
        TomlReader inner = *ellipsoid;
        const Eigen::Vector3d centre = inner.required_vector("centre_mm", any_length);
        shape.solid = Ellipsoid{centre, inner.required_vector("radii_mm", positive_length)};
        inner.finish();
    }
    reader.finish();
    return shape;
}

void read_fibre_arrays(const std::optional<std::string>& mesh, const std::filesystem::path& folder,
                       const NameUses& uses, Scene& scene) {
    for (const auto& [label, array, place] : uses.fibre_arrays) {
        if (!mesh)
            throw InvalidInput(place +
                               ": 'fibre_array' is a cell array of the geometry's mesh file, and the scene has "
                               "none; give 'mesh' in [geometry], or 'fibre' or 'fibre_file'");
        const Eigen::MatrixXd values = meshing::read_vtu_cell_array(folder / *mesh, array);
        if (values.rows() != 3)
            throw InvalidInput(place + ": the cell array '" + array + "' has " + std::to_string(values.rows()) +
                               " components; fibres have three, LPS");
        scene.tissues[label].fibres = FibresOfTetrahedra{values};
    }
}

/// Keeps what is passed on, for messages that end the run.
struct NotesOfMesh : Observer {
    explicit NotesOfMesh(Observer& listening) : next(listening) {}
    void note(std::string_view message) override {
        text.append("; ").append(message);
        next.note(message);
    }
    Observer& next;
    std::string text{};  ///< "; " before each
};

tled::EquilibriumMethod method_named(const std::string& name) {
    if (name == "relaxation") return tled::EquilibriumMethod::SelfCheckedRelaxation;
    if (name == "lbfgs") return tled::EquilibriumMethod::Lbfgs;
    return name == "newton" ? tled::EquilibriumMethod::Newton : tled::EquilibriumMethod::Automatic;
}

}  // namespace

void read_geometry(TomlReader& file, const std::filesystem::path& folder, Scene& scene, NameUses& uses,
                   Observer& observer) {
    auto geometry = file.table("geometry");
    if (!geometry) throw InvalidInput(file.place() + ": the scene lacks [geometry]");
    const auto labels = geometry->text("labels"), mesh = geometry->text("mesh");
    const auto box = geometry->table("box");
    auto shapes = geometry->tables("shape");
    const double edge_length = geometry->number("edge_length_mm", edge).value_or(5.0);
    const auto label_edge_length = geometry->by_label("label_edge_length_mm", edge);
    for (const auto& [label, length] : label_edge_length)
        uses.volume_labels.push_back({label, geometry->place("label_edge_length_mm"), "has an edge length"});
    geometry->finish();
    if (int(labels.has_value()) + int(mesh.has_value()) + int(box.has_value()) + int(!shapes.empty()) != 1)
        throw InvalidInput(geometry->place() + ": [geometry] takes one of 'labels', 'mesh', 'box' and 'shape'");
    if (box) {
        scene.geometry = box_geometry(*box);
    } else if (labels) {
        scene.geometry = LabelledVolume{read_noted_labels(folder / *labels, observer), edge_length, label_edge_length};
    } else if (mesh) {
        NotesOfMesh notes(observer);
        scene.geometry = meshing::read_vtu(folder / *mesh, notes);
        uses.geometry_notes = notes.text;
    } else {
        ShapeGeometry painted;
        for (TomlReader& shape : shapes) painted.shapes.push_back(shape_of(shape));
        painted.edge_length = edge_length;
        painted.label_edge_length = label_edge_length;
        scene.geometry = painted;
    }
    read_fibre_arrays(mesh, folder, uses, scene);
}

void read_solve(TomlReader& file, Scene& scene) {
    auto reader = file.table("solve");
    if (!reader) return;
    Solve& solve = scene.solve;
    const std::string kind = reader->one_of("kind", {"equilibrium", "dynamics"}, "equilibrium");
    solve.kind = kind == "dynamics" ? Solve::Kind::Dynamics : Solve::Kind::Equilibrium;
    solve.duration = reader->number("duration_s", {1e-6, 1e6, "s"}).value_or(solve.duration);
    solve.frames = reader->whole("frames", 1, 100000).value_or(solve.frames);
    solve.tolerance_mm = reader->number("tolerance_mm", {1e-6, 10.0, "mm"}).value_or(solve.tolerance_mm);
    solve.method = method_named(reader->one_of("method", {"auto", "relaxation", "lbfgs", "newton"}, "auto"));
    solve.load_steps = reader->whole("load_steps", 1, 1000).value_or(solve.load_steps);
    const std::string precision = reader->one_of("precision", {"float32", "float64"}, "float32");
    solve.precision = precision == "float64" ? tled::Scalar::Float64 : tled::Scalar::Float32;
    solve.damping = reader->number("damping_per_s", {0.0, 1e6, "1/s"}).value_or(solve.damping);
    solve.step = reader->number("step_s", {0.0, 1.0, "s"}).value_or(solve.step);
    const std::string element = reader->one_of("element", {"auto", "t4", "averaged-pressure"}, "auto");
    if (element != "auto") solve.element = element == "t4" ? tled::Element::T4 : tled::Element::AveragedPressureT4;
    const std::string device = reader->one_of("device", {"auto", "cpu", "gpu"}, "auto");
    solve.device = device == "cpu" ? Device::Cpu : device == "gpu" ? Device::Gpu : Device::Auto;
    reader->finish();
}

}  // namespace tissuewarp::apps
