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
    const std::set<int> labels(model.mesh.labels.begin(), model.mesh.labels.end());
    for (const int label : labels) {
        const auto material = model.materials.find(label);
        if (material == model.materials.end())
            throw InvalidInput("label " + std::to_string(label) + " of the mesh has no material; add it to the table");
        const std::string of_label = " of label " + std::to_string(label);
        require_positive(shear_modulus(material->second), "shear modulus" + of_label, "kPa");
        const double bulk_modulus = p_wave_modulus(material->second) - 4 * shear_modulus(material->second) / 3;
        require_positive(bulk_modulus, "bulk modulus at rest" + of_label, "kPa");
    }
}

Element suggested_element(const MaterialTable& materials) {
    for (const auto& [label, material] : materials)
        if (poisson_ratio(material) > 0.46) return Element::AveragedPressureT4;
    return Element::T4;
}

}  // namespace tissuewarp::tled
