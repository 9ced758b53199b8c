// Before the operation: the model.

#include "python/core/arrays.hpp"
#include "python/core/bindings.hpp"
#include "python/core/observer.hpp"
#include "registration/prepare.hpp"
#include "registration/prepared/prepared_io.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

namespace tissuewarp::python {

using imaging::Volume;
using meshing::TetMesh;
using registration::PreparedModel;
using registration::PrepareOptions;
using Model = std::shared_ptr<PreparedModel>;

namespace {

/// Young's modulus (kPa), Poisson's ratio.
using Moduli = std::array<double, 2>;

PrepareOptions options_of(double edge_length, const std::map<int, double>& label_edge_length,
                          const std::map<int, Moduli>& materials, const Moduli& default_material,
                          std::vector<int> anchors, std::vector<int> rigid_neighbours, std::vector<int> resected,
                          std::vector<std::array<int, 2>> sliding) {
    PrepareOptions options;
    options.meshing.edge_length = edge_length;
    options.meshing.label_edge_length = label_edge_length;
    for (const auto& [label, moduli] : materials)
        options.materials[label] = tled::neo_hookean_lnj(moduli[0], moduli[1]);
    options.default_material = tled::neo_hookean_lnj(default_material[0], default_material[1]);
    options.anchors = std::move(anchors);
    options.rigid_neighbours = std::move(rigid_neighbours);
    options.resected = std::move(resected);
    options.sliding = std::move(sliding);
    return options;
}

Model prepare(const Volume& labels, const TetMesh* mesh, const PrepareOptions& options, py::object progress) {
    return observed(std::move(progress), [&](Observer& observer) {
        return std::make_shared<PreparedModel>(mesh ? registration::prepare(*mesh, labels, options, observer)
                                                    : registration::prepare(labels, options, observer));
    });
}

void prepare_image(PreparedModel& model, const Volume& image, py::object progress) {
    observed(std::move(progress), [&](Observer& observer) { registration::prepare_image(model, image, {}, observer); });
}

void prepare_contrast(PreparedModel& model, const Volume& image, py::object progress) {
    observed(std::move(progress),
             [&](Observer& observer) { registration::prepare_contrast(model, image, {}, observer); });
}

void prepare_loads(PreparedModel& model, py::object progress) {
    observed(std::move(progress), [&](Observer& observer) { registration::prepare_loads(model, observer); });
}

Model read(const std::filesystem::path& path, py::object progress) {
    return observed(std::move(progress), [&](Observer& observer) {
        return std::make_shared<PreparedModel>(registration::read_prepared(path, observer));
    });
}

}  // namespace

void bind_models(py::module_& module) {
    py::class_<PrepareOptions>(module, "PrepareOptions")
        .def(py::init(&options_of), py::arg("edge_length"), py::arg("label_edge_length"), py::arg("materials"),
             py::arg("default_material"), py::arg("anchors"), py::arg("rigid_neighbours"), py::arg("resected"),
             py::arg("sliding"));
    py::class_<PreparedModel, Model>(module, "PreparedModel")
        .def_property_readonly(
            "mesh", [](const PreparedModel& model) -> const TetMesh& { return model.model.mesh; },
            py::return_value_policy::reference_internal)
        .def_property_readonly("labels", [](const PreparedModel& model) { return model.labels; });
    module.def("prepare", &prepare, py::arg("labels"), py::arg("mesh").none(true), py::arg("options"),
               py::arg("progress"));
    module.def("prepare_image", &prepare_image, py::arg("model"), py::arg("image"), py::arg("progress"));
    module.def("prepare_contrast", &prepare_contrast, py::arg("model"), py::arg("image"), py::arg("progress"));
    module.def("prepare_loads", &prepare_loads, py::arg("model"), py::arg("progress"));
    module.def("suggested_edge_length", &registration::suggested_edge_length, py::arg("labels"),
               py::call_guard<py::gil_scoped_release>());
    module.def("suggested_edge_length_without_labels", &registration::suggested_edge_length_without_labels,
               py::arg("labels"), py::call_guard<py::gil_scoped_release>());
    module.def("write_prepared", &registration::write_prepared, py::arg("model"), py::arg("path"),
               py::call_guard<py::gil_scoped_release>());
    module.def("read_prepared", &read, py::arg("path"), py::arg("progress"));
}

}  // namespace tissuewarp::python
