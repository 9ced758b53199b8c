// Volumes and their files.

#include "imaging/image_io.hpp"
#include "python/core/arrays.hpp"
#include "python/core/bindings.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

namespace tissuewarp::python {

using imaging::Geometry;
using imaging::Volume;

namespace {

Geometry geometry_of(const std::array<int, 3>& size, const Eigen::Vector3d& origin, const Eigen::Vector3d& spacing,
                     const Eigen::Matrix3d& direction) {
    Geometry grid{size, origin, spacing, direction};
    imaging::require_valid(grid, "image");
    return grid;
}

Volume make_volume(const py::array& array, const Eigen::Vector3d& origin, const Eigen::Vector3d& spacing,
                   const Eigen::Matrix3d& direction, const py::object& owner) {
    std::array<int, 3> size{1, 1, 1};  // of arrays without an image's shape, which volume_of refuses
    for (int axis = 0; array.ndim() >= 3 && axis < 3; ++axis)
        size[static_cast<std::size_t>(axis)] = static_cast<int>(array.shape(2 - axis));
    return volume_of(array, geometry_of(size, origin, spacing, direction), owner);
}

py::tuple with_notes(imaging::ReadResult (*read)(const std::filesystem::path&), const std::filesystem::path& path) {
    imaging::ReadResult result;
    {
        const py::gil_scoped_release released;
        result = read(path);
    }
    return py::make_tuple(std::move(result.volume), result.notes);
}

}  // namespace

void bind_images(py::module_& module) {
    py::class_<Geometry>(module, "Geometry")
        .def(py::init(&geometry_of), py::arg("size"), py::arg("origin"), py::arg("spacing"), py::arg("direction"))
        .def_readonly("size", &Geometry::size)
        .def_readonly("origin", &Geometry::origin)
        .def_readonly("spacing", &Geometry::spacing)
        .def_readonly("direction", &Geometry::direction)
        .def("index_to_point", &Geometry::index_to_point);
    py::class_<Volume>(module, "Volume")
        .def(py::init(&make_volume), py::arg("array"), py::arg("origin"), py::arg("spacing"), py::arg("direction"),
             py::arg("owner") = py::none())
        .def_property_readonly("array", &array_of)
        .def_property_readonly("geometry", [](const Volume& volume) { return volume.geometry; });
    module.def(
        "as_labels",
        [](const Volume& volume, const std::string& name) {
            if (volume.voxels.type() == CV_32SC1) return volume;
            return imaging::as_labels({volume, {}, {}}, name).volume;
        },
        py::arg("volume"), py::arg("name"), py::call_guard<py::gil_scoped_release>());
    module.def(
        "read_volume",
        [](const std::filesystem::path& path) { return with_notes(imaging::read_volume_with_notes, path); },
        py::arg("path"));
    module.def(
        "read_labels",
        [](const std::filesystem::path& path) { return with_notes(imaging::read_labels_with_notes, path); },
        py::arg("path"));
    module.def("write_volume", &imaging::write_volume, py::arg("volume"), py::arg("path"),
               py::call_guard<py::gil_scoped_release>());
}

}  // namespace tissuewarp::python
