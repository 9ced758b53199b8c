#include "tled/model.hpp"

#include "core/errors.hpp"

#include <cmath>
#include <set>
#include <string>

namespace tissuewarp::tled {

namespace {

void require_positive(double value, const std::string& what, const std::string& unit) {
    if (!(value > 0) || !std::isfinite(value))
        throw InvalidInput(what + " is " + std::to_string(value) + " " + unit + "; it must be positive and finite");
}

}  // namespace

void require_valid(const Model& model) {
    meshing::require_valid(model.mesh, "the model's mesh");
    require_positive(model.density, "density", "kg/mm3");
    if (model.fibre.size() > 0 && model.fibre.cols() != model.mesh.tet_count())
        throw InvalidInput("the model has " + std::to_string(model.fibre.cols()) + " fibre directions for " +
                           std::to_string(model.mesh.tet_count()) + " elements; give one for each or none");
    for (Eigen::Index t = 0; t < model.fibre.cols(); ++t)
        if (!(std::abs(model.fibre.col(t).norm() - 1) < 1e-6))
            throw InvalidInput("the fibre direction of element " + std::to_string(t) + " has length " +
                               std::to_string(model.fibre.col(t).norm()) + "; it must be a unit vector");
    for (const int label : std::set<int>(model.mesh.labels.begin(), model.mesh.labels.end())) {
        const auto material = model.materials.find(label);
        if (material == model.materials.end())
            throw InvalidInput("label " + std::to_string(label) + " of the mesh has no material; add it to the table");
        require_valid(material->second, "label " + std::to_string(label));
    }
    for (const auto& [label, series] : model.viscosity) {
        require_valid(series, "label " + std::to_string(label));
        if (!model.materials.contains(label))
            throw InvalidInput("label " + std::to_string(label) + " has viscosity but no material");
    }
}

Model relaxed(Model model) {
    for (const auto& [label, series] : model.viscosity) {
        Material& material = model.materials.at(label);
        material = with_shear_scaled(material, relaxed_fraction(series));
    }
    model.viscosity.clear();
    return model;
}

Element suggested_element(const MaterialTable& materials) {
    for (const auto& [label, material] : materials)
        if (poisson_ratio(material) > 0.46) return Element::AveragedPressureT4;
    return Element::T4;
}

}  // namespace tissuewarp::tled
