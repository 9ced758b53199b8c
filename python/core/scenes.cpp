// Simulations without a registration.

#include "apps/scene_file.hpp"
#include "python/core/arrays.hpp"
#include "python/core/bindings.hpp"
#include "python/core/observer.hpp"
#include "simulation/limits.hpp"
#include "simulation/run.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

namespace tissuewarp::python {

namespace {

/// All frames of a run.
struct Frames {
    meshing::TetMesh mesh;
    std::vector<double> times;
    std::vector<Eigen::Matrix3Xd> displacements, probes;  ///< by frame
    std::vector<std::string> probe_names;
    simulation::RunSummary summary;
};

Frames run(const simulation::Scene& scene, Observer& observer) {
    simulation::require_supported(scene);
    const simulation::BuiltScene built = simulation::build(scene, observer);
    Frames frames;
    const auto keep = [&](const simulation::Frame& frame) {
        frames.times.push_back(frame.time);
        frames.displacements.push_back(simulation::on_scene_mesh(built, frame));
        frames.probes.push_back(simulation::probe_displacements(built, frame));
    };
    frames.summary = simulation::simulate(built, keep, observer);
    frames.mesh = built.mesh;
    for (const simulation::Probe& probe : scene.probes) frames.probe_names.push_back(probe.name);
    return frames;
}

py::array frame(const py::object& self, std::size_t index) {
    return transposed_view(self.cast<const Frames&>().displacements.at(index), self);
}

py::array probe_frame(const py::object& self, std::size_t index) {
    return transposed_view(self.cast<const Frames&>().probes.at(index), self);
}

}  // namespace

void bind_scenes(py::module_& module) {
    py::class_<Frames>(module, "Frames")
        .def_readonly("mesh", &Frames::mesh)
        .def_readonly("times", &Frames::times)
        .def_readonly("probe_names", &Frames::probe_names)
        .def_property_readonly("engine", [](const Frames& frames) { return frames.summary.engine; })
        .def_property_readonly("min_jacobian", [](const Frames& frames) { return frames.summary.min_jacobian; })
        .def("displacement", &frame, py::arg("index"))
        .def("probes", &probe_frame, py::arg("index"));
    module.def(
        "simulate_file",
        [](const std::filesystem::path& path, py::object progress) {
            return observed(std::move(progress),
                            [&](Observer& observer) { return run(apps::read_scene(path, observer), observer); });
        },
        py::arg("path"), py::arg("progress"));
    module.def(
        "simulate_text",
        [](const std::string& text, const std::filesystem::path& folder, py::object progress) {
            return observed(std::move(progress), [&](Observer& observer) {
                return run(apps::scene_of_text(text, folder, observer), observer);
            });
        },
        py::arg("text"), py::arg("folder"), py::arg("progress"));
}

}  // namespace tissuewarp::python
