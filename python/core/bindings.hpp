#pragma once
/// The parts of the module tissuewarp._core. The Python files beside it are what people call; they turn images of other
/// libraries into these and say shapes and units.

#include <pybind11/pybind11.h>

namespace tissuewarp::python {

void bind_errors();
void bind_images(pybind11::module_& module);
void bind_meshes(pybind11::module_& module);
void bind_models(pybind11::module_& module);
void bind_updates(pybind11::module_& module);
void bind_results(pybind11::module_& module);
void bind_scenes(pybind11::module_& module);

}  // namespace tissuewarp::python
