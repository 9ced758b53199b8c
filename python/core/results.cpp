// What an update found: points, fields, images, errors.

#include "python/core/arrays.hpp"
#include "python/core/bindings.hpp"
#include "python/core/observer.hpp"
#include "registration/field/inverse_transform.hpp"
#include "registration/surroundings/rigid_surroundings.hpp"
#include "registration/uncertainty.hpp"
#include "registration/warp.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <limits>

namespace tissuewarp::python {

using registration::Doubt;
using registration::ErrorEstimate;
using registration::PreparedModel;
using registration::Uncertainty;
using registration::UpdateResult;
using Estimates = std::vector<std::optional<ErrorEstimate>>;

namespace {

template <class Transform>
py::array transformed(const Transform& transform, const Points& points) {
    Eigen::Matrix3Xd mapped;
    {
        const py::gil_scoped_release released;
        mapped = transform(points.transpose());
    }
    return transposed(std::move(mapped));
}

py::array displacement_of(const py::object& self) {
    return transposed_view(self.cast<const UpdateResult&>().deformation.displacement, self);
}

py::array column(const Estimates& estimates, double ErrorEstimate::*member) {
    py::array_t<double> values(static_cast<py::ssize_t>(estimates.size()));
    for (std::size_t p = 0; p < estimates.size(); ++p)
        values.mutable_at(static_cast<py::ssize_t>(p)) =
            estimates[p] ? (*estimates[p]).*member : std::numeric_limits<double>::quiet_NaN();
    return values;
}

py::dict columns(const Uncertainty& uncertainty, const Points& points) {
    Estimates estimates;
    {
        const py::gil_scoped_release released;
        estimates = uncertainty.at(Eigen::Matrix3Xd(points.transpose()));
    }
    const auto count = static_cast<py::ssize_t>(estimates.size());
    py::array_t<std::uint8_t> trust(count);
    py::array_t<double> covariance(std::vector<py::ssize_t>{count, 3, 3});
    for (py::ssize_t p = 0; p < count; ++p) {
        const auto& estimate = estimates[static_cast<std::size_t>(p)];
        trust.mutable_at(p) = static_cast<std::uint8_t>(estimate ? estimate->trust : registration::Trust::Outside);
        for (int row = 0; row < 3; ++row)
            for (int axis = 0; axis < 3; ++axis)
                covariance.mutable_at(p, row, axis) =
                    estimate ? estimate->covariance(row, axis) : std::numeric_limits<double>::quiet_NaN();
    }
    py::dict result;
    result["solver_mm"] = column(estimates, &ErrorEstimate::algebraic_mm);
    result["mesh_mm"] = column(estimates, &ErrorEstimate::discretisation_mm);
    result["data_mm"] = column(estimates, &ErrorEstimate::data_mm);
    result["deviation_mm"] = column(estimates, &ErrorEstimate::deviation_mm);
    result["interval_mm"] = column(estimates, &ErrorEstimate::interval_mm);
    result["covariance_mm2"] = covariance;
    result["trust"] = trust;
    return result;
}

void bind_doubt(py::module_& module) {
    py::class_<Doubt>(module, "Doubt", "A reason not to trust a result (the manual, doubts).")
        .def_readonly("code", &Doubt::code, "Which one: 'labels.unmatched'.")
        .def_readonly("value", &Doubt::value, "What was found.")
        .def_readonly("limit", &Doubt::limit, "What would have been in order.")
        .def_readonly("text", &Doubt::text, "What is the matter, for people.")
        .def_readonly("remedy", &Doubt::remedy, "What to do about it.")
        .def_property_readonly(
            "severity", [](const Doubt& doubt) { return registration::name_of(doubt.severity); },
            "'notice' or 'doubt'.")
        .def("__repr__", [](const Doubt& doubt) { return "<Doubt " + doubt.code + ": " + full_text(doubt) + ">"; });
}

void bind_transforms(py::module_& module) {
    using registration::InversePointTransform;
    using registration::PointTransform;
    const auto forward = [](const UpdateResult& result) { return PointTransform(result.deformation); };
    const auto inverse = [](const UpdateResult& result) { return InversePointTransform(result.deformation); };
    py::class_<PointTransform>(module, "PointTransform")
        .def(py::init(forward), py::arg("result"), py::call_guard<py::gil_scoped_release>())
        .def("__call__", &transformed<PointTransform>, py::arg("points"));
    py::class_<InversePointTransform>(module, "InversePointTransform")
        .def(py::init(inverse), py::arg("result"), py::call_guard<py::gil_scoped_release>())
        .def("__call__", &transformed<InversePointTransform>, py::arg("points"));
}

void bind_uncertainty(py::module_& module) {
    py::class_<Uncertainty>(module, "Uncertainty")
        .def("at", &columns, py::arg("points"))
        .def(
            "doubts",
            [](const Uncertainty& self, double tolerance) { return registration::doubts_of(self, tolerance); },
            py::arg("tolerance"))
        .def(
            "on_grid",
            [](const Uncertainty& self, const UpdateResult& result, const imaging::Geometry& grid) {
                auto volumes = registration::uncertainty_on_grid(self, result.deformation, grid);
                return std::pair(std::move(volumes.deviation), std::move(volumes.trust));
            },
            py::arg("result"), py::arg("grid"), py::call_guard<py::gil_scoped_release>());
    module.def(
        "uncertainty",
        [](const PreparedModel& model, const UpdateResult& result, py::object progress) {
            return observed(std::move(progress),
                            [&](Observer& observer) { return registration::uncertainty(model, result, {}, observer); });
        },
        py::arg("model"), py::arg("result"), py::arg("progress"));
}

void bind_fields(py::module_& module) {
    module.def(
        "hold_surroundings",
        [](UpdateResult& result, const imaging::Volume& moving, const imaging::Volume& fixed) {
            observed(py::none(), [&](Observer& observer) {
                registration::Deformation& deformation = result.deformation;
                deformation.surroundings = registration::rigid_surroundings(deformation, moving, fixed, {}, observer);
            });
        },
        py::arg("result"), py::arg("moving"), py::arg("fixed"));
    module.def(
        "field_moving_to_fixed",
        [](const UpdateResult& result, const imaging::Geometry& grid) {
            imaging::Volume field = registration::displacement_moving_to_fixed(result.deformation, grid);
            registration::unfold_moving_to_fixed(field, result.deformation);
            return field;
        },
        py::arg("result"), py::arg("grid"), py::call_guard<py::gil_scoped_release>());
    module.def(
        "field_fixed_to_moving",
        [](const UpdateResult& result, const imaging::Geometry& grid) {
            imaging::Volume field = registration::displacement_fixed_to_moving(result.deformation, grid);
            registration::unfold_fixed_to_moving(field, result.deformation);
            return field;
        },
        py::arg("result"), py::arg("grid"), py::call_guard<py::gil_scoped_release>());
    module.def("warp_image", &registration::warp_image, py::arg("image"), py::arg("field"), py::arg("outside"),
               py::call_guard<py::gil_scoped_release>());
    module.def("warp_labels", &registration::warp_labels, py::arg("labels"), py::arg("field"),
               py::call_guard<py::gil_scoped_release>());
}

}  // namespace

void bind_results(py::module_& module) {
    bind_doubt(module);
    py::class_<UpdateResult>(module, "UpdateResult")
        .def_property_readonly(
            "mesh", [](const UpdateResult& result) -> const meshing::TetMesh& { return result.deformation.mesh; },
            py::return_value_policy::reference_internal)
        .def_property_readonly("displacement", &displacement_of)
        .def_property_readonly("placement",
                               [](const UpdateResult& result) { return result.deformation.placement.matrix(); })
        .def_readonly("engine", &UpdateResult::engine)
        .def_readonly("min_jacobian", &UpdateResult::min_jacobian)
        .def_readonly("cut_short", &UpdateResult::cut_short)
        .def_property_readonly("began_at_last", [](const UpdateResult& result) { return result.beginning.at_last; })
        .def_property_readonly("why_begun_anew", [](const UpdateResult& result) { return result.beginning.why; })
        .def_readonly("doubts", &UpdateResult::doubts)
        .def_property_readonly("times", [](const UpdateResult& result) {
            std::map<std::string, double> seconds;
            for (const auto& time : result.times) seconds[time.stage] += time.seconds;
            return seconds;
        });
    bind_transforms(module);
    bind_fields(module);
    bind_uncertainty(module);
}

}  // namespace tissuewarp::python
