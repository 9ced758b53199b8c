#include "core/errors.hpp"
#include "python/core/bindings.hpp"
#include "tled/blas_threads.hpp"

namespace tissuewarp::python {

namespace py = pybind11;

namespace {

void throw_as(const char* name, const std::exception& problem) {
    const py::object type = py::module_::import("tissuewarp.errors").attr(name);
    PyErr_SetString(type.ptr(), problem.what());
}

}  // namespace

/// As the classes of tissuewarp/errors.py.
void bind_errors() {
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const InvalidInput& problem) {
            throw_as("InvalidInput", problem);
        } catch (const IoError& problem) {
            throw_as("IoError", problem);
        } catch (const SolverFailure& problem) {
            throw_as("SolverFailure", problem);
        } catch (const GpuUnavailable& problem) {
            throw_as("GpuUnavailable", problem);
        } catch (const Cancelled& problem) {
            throw_as("Cancelled", problem);
        } catch (const Error& problem) {
            throw_as("Error", problem);
        }
    });
}

}  // namespace tissuewarp::python

PYBIND11_MODULE(_core, module) {
    using namespace tissuewarp;
    module.doc() = "What tissuewarp's Python files call; not for programs.";
    module.attr("version") = TISSUEWARP_VERSION;
    python::bind_errors();
    python::bind_images(module);
    python::bind_meshes(module);
    python::bind_models(module);
    python::bind_updates(module);
    python::bind_results(module);
    python::bind_scenes(module);
    module.def("let_solves_take_one_blas_thread", &tled::let_solves_take_one_blas_thread, pybind11::arg("allowed"));
}
