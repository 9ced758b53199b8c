// During the operation: what is seen, and the updates.

#include "python/core/arrays.hpp"
#include "python/core/bindings.hpp"
#include "python/core/observer.hpp"
#include "registration/update.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

namespace tissuewarp::python {

using registration::Curves;
using registration::Intraoperative;
using registration::PointPairs;
using registration::PreparedModel;
using registration::SurfacePoints;
using registration::UpdateOptions;
using registration::Updater;
using registration::UpdateResult;

namespace {

SurfacePoints surface_points(const Points& points, const std::optional<Points>& normals, double deviation) {
    return {points.transpose(), normals ? Eigen::Matrix3Xd(normals->transpose()) : Eigen::Matrix3Xd(3, 0), deviation};
}

PointPairs point_pairs(const Points& moving, const Points& fixed, double deviation) {
    return {moving.transpose(), fixed.transpose(), deviation};
}

Curves curves(const std::vector<Points>& moving, const Points& fixed, const std::optional<Points>& tangents,
              double deviation) {
    Curves result{{}, fixed.transpose(), Eigen::Matrix3Xd(3, 0), deviation};
    for (const Points& line : moving) result.moving.emplace_back(line.transpose());
    if (tangents) result.tangents = tangents->transpose();
    return result;
}

UpdateOptions options_of(bool align, int rounds, double tolerance, double time_budget, int device, int gpu_index) {
    UpdateOptions options;
    options.align = align;
    options.rematches = rounds;
    options.equilibrium.tolerance_mm = tolerance;
    options.time_budget_s = time_budget;
    options.device = static_cast<registration::Device>(device);
    options.gpu_index = gpu_index;
    return options;
}

std::unique_ptr<Updater> make_updater(std::shared_ptr<PreparedModel> model, const UpdateOptions& options,
                                      py::object progress) {
    return observed(std::move(progress), [&](Observer& observer) {
        return std::make_unique<Updater>(std::shared_ptr<const PreparedModel>(model), options, observer);
    });
}

UpdateResult update(Updater& updater, const Intraoperative& seen, const UpdateResult* last, py::object progress) {
    return observed(std::move(progress), [&](Observer& observer) {
        return last ? updater.go_on(*last, seen, observer) : updater.update(seen, observer);
    });
}

}  // namespace

void bind_updates(py::module_& module) {
    py::class_<SurfacePoints>(module, "SurfacePoints")
        .def(py::init(&surface_points), py::arg("points"), py::arg("normals"), py::arg("deviation"));
    py::class_<PointPairs>(module, "PointPairs")
        .def(py::init(&point_pairs), py::arg("moving"), py::arg("fixed"), py::arg("deviation"));
    py::class_<Curves>(module, "Curves")
        .def(py::init(&curves), py::arg("moving"), py::arg("fixed"), py::arg("tangents"), py::arg("deviation"));
    py::class_<Intraoperative>(module, "Intraoperative")
        .def(py::init<>())
        .def_readwrite("labels", &Intraoperative::labels)
        .def_readwrite("image", &Intraoperative::image)
        .def_readwrite("contrasts", &Intraoperative::contrasts)
        .def_readwrite("surface", &Intraoperative::surface)
        .def_readwrite("points", &Intraoperative::points)
        .def_readwrite("curves", &Intraoperative::curves)
        .def(
            "set_start",
            [](Intraoperative& seen, const Eigen::Matrix4d& matrix) { seen.start = Eigen::Isometry3d(matrix); },
            py::arg("matrix"));
    py::class_<UpdateOptions>(module, "UpdateOptions")
        .def(py::init(&options_of), py::arg("align"), py::arg("rounds"), py::arg("tolerance"), py::arg("time_budget"),
             py::arg("device"), py::arg("gpu_index"));
    py::class_<Updater>(module, "Updater")
        .def(py::init(&make_updater), py::arg("model"), py::arg("options"), py::arg("progress"))
        .def("update", &update, py::arg("seen"), py::arg("last"), py::arg("progress"));
}

}  // namespace tissuewarp::python
