// Tetrahedra as arrays.

#include "meshing/mesh_io.hpp"
#include "python/core/arrays.hpp"
#include "python/core/bindings.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl/filesystem.h>

namespace tissuewarp::python {

using meshing::TetMesh;

namespace {

using Tets = Eigen::Matrix<int, Eigen::Dynamic, 4, Eigen::RowMajor>;

TetMesh make_mesh(const Points& nodes, const Tets& tets, const Eigen::VectorXi& labels) {
    TetMesh mesh{nodes.transpose(), tets.transpose(), labels};
    meshing::require_valid(mesh, "mesh");
    return mesh;
}

}  // namespace

void bind_meshes(py::module_& module) {
    const auto of = [](const py::object& self) -> const TetMesh& { return self.cast<const TetMesh&>(); };
    py::class_<TetMesh>(module, "Mesh", "Tetrahedra; lengths in mm, LPS. Arrays are views of the mesh, not copies.")
        .def(py::init(&make_mesh), py::arg("nodes"), py::arg("tets"), py::arg("labels"))
        .def_property_readonly(
            "nodes", [of](const py::object& self) { return transposed_view(of(self).nodes, self); },
            "Positions of the nodes at rest, (N, 3) float64, LPS mm.")
        .def_property_readonly(
            "tets", [of](const py::object& self) { return transposed_view(of(self).tets, self); },
            "Nodes of each tetrahedron, (M, 4) int32.")
        .def_property_readonly(
            "labels",
            [of](const py::object& self) {
                py::array_t<int> view(of(self).labels.size(), of(self).labels.data(), self);
                view.attr("flags").attr("writeable") = false;
                return view;
            },
            "Label of each tetrahedron, (M,) int32.")
        .def(
            "write", [](const TetMesh& mesh, const std::filesystem::path& path) { meshing::write_vtu(mesh, path); },
            py::arg("path"), "Writes a .vtu file, which ParaView reads.");
}

}  // namespace tissuewarp::python
