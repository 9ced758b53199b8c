#include "registration/detail/fit_scalars.hpp"

#include "registration/uncertainty/doubts.hpp"

#include <array>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

constexpr std::array<const char*, 3> axis_suffix{"-x", "-y", "-z"};
constexpr double standard_gravity = 9806.65;  // mm/s²

double youngs_modulus(const tled::Material& material) {
    return 2 * tled::shear_modulus(material) * (1 + tled::poisson_ratio(material));
}

/// A neo-Hookean law of other constants.
tled::Material with_constants(const tled::Material& material, double youngs_modulus_kpa, double poisson_ratio) {
    if (std::holds_alternative<tled::NeoHookeanIso>(material))
        return tled::neo_hookean_iso(youngs_modulus_kpa, poisson_ratio);
    if (std::holds_alternative<tled::NeoHookeanStable>(material))
        return tled::neo_hookean_stable(youngs_modulus_kpa, poisson_ratio);
    return tled::neo_hookean_lnj(youngs_modulus_kpa, poisson_ratio);
}

void require_neo_hookean(const tled::Material& material, int label) {
    if (std::holds_alternative<tled::NeoHookeanIso>(material) ||
        std::holds_alternative<tled::NeoHookeanLnJ>(material) ||
        std::holds_alternative<tled::NeoHookeanStable>(material))
        return;
    throw InvalidInput("label " + std::to_string(label) + " has the law " + tled::law_name(material) +
                       ", of which neither Poisson's ratio nor stiffness are fitted; give it a neo-Hookean law");
}

std::string labels_of(const tled::MaterialTable& materials) {
    std::string text;
    for (const auto& [label, material] : materials) text.append(text.empty() ? "" : ", ").append(std::to_string(label));
    return text;
}

void require_label(const PreparedModel& prepared, const FitParameter& parameter) {
    const tled::MaterialTable& materials = prepared.model.materials;
    const auto found = materials.find(parameter.label);
    if (found == materials.end())
        throw InvalidInput("'" + name_of(parameter) + "' names a label that the model has not; it has " +
                           labels_of(materials));
    require_neo_hookean(found->second, parameter.label);
}

/// Volume (mm³) and its product with Young's modulus, of labels other than `left_out`.
struct Stiffness {
    double volume = 0, modulus_volume = 0;
    [[nodiscard]] double mean() const { return modulus_volume / volume; }
};
Stiffness stiffness_without(const PreparedModel& prepared, int left_out) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    Stiffness sum;
    for (Eigen::Index tet = 0; tet < volumes.size(); ++tet) {
        const int label = mesh.labels[tet];
        if (label == left_out) continue;
        sum.volume += volumes[tet];
        sum.modulus_volume += volumes[tet] * youngs_modulus(prepared.model.materials.at(label));
    }
    return sum;
}

/// Of the tissue as a whole, volume-weighted.
std::string at_modulus(const std::string& unit, const PreparedModel& prepared) {
    return unit + " at E = " + to_text(stiffness_without(prepared, 0).mean()) + " kPa";
}

FitScalar poissons_ratio(const PreparedModel& prepared, const FitParameter& parameter) {
    // Beyond, linear tetrahedra lock, which is no property of the tissue.
    const double most = prepared.model.element == tled::Element::T4 ? 0.46 : 0.49;
    constexpr double least = 0.05;
    FitScalar scalar;
    if (parameter.label != 0) require_label(prepared, parameter);
    const auto& materials = prepared.model.materials;
    scalar.given =
        tled::poisson_ratio(parameter.label == 0 ? materials.begin()->second : materials.at(parameter.label));
    for (const auto& [label, material] : materials) {
        if (parameter.label != 0) break;
        require_neo_hookean(material, label);
        if (std::abs(tled::poisson_ratio(material) - scalar.given) > 1e-9)
            throw InvalidInput("the labels " + labels_of(materials) +
                               " have different Poisson's ratios; name the one to fit, as in 'poissons-ratio:" +
                               std::to_string(label) + "'");
    }
    if (scalar.given < least || scalar.given > most)
        throw InvalidInput("Poisson's ratio is given as " + to_text(scalar.given) + "; it is fitted between " +
                           to_text(least) + " and " + to_text(most) + ", beyond which elements lock: leave it out");
    scalar.least = (least - scalar.given) / parameter.deviation;
    scalar.most = (most - scalar.given) / parameter.deviation;
    return scalar;
}

FitScalar stiffness_ratio(const PreparedModel& prepared, const FitParameter& parameter) {
    require_label(prepared, parameter);
    const Stiffness others = stiffness_without(prepared, parameter.label);
    if (others.volume == 0)
        throw InvalidInput("'" + name_of(parameter) + "' is the stiffness over that of other labels, and the model " +
                           "has this one alone; only ratios tell in a displacement");
    FitScalar scalar;
    scalar.given = youngs_modulus(prepared.model.materials.at(parameter.label)) / others.mean();
    scalar.least = -3;
    scalar.most = 3;
    return scalar;
}

FitScalar gravity(const PreparedModel& prepared, const TissueLoads& loads, int axis) {
    FitScalar scalar;
    scalar.unit = at_modulus("g", prepared);
    scalar.to_load = prepared.model.density * standard_gravity;
    scalar.given = loads.body_force[axis] / scalar.to_load;
    return scalar;
}

FitScalar pressure(const PreparedModel& prepared, const TissueLoads& loads) {
    FitScalar scalar;
    scalar.unit = at_modulus("kPa", prepared);
    scalar.given = loads.pressure_kpa;
    return scalar;
}

FitScalar scalar_of(const PreparedModel& prepared, const TissueLoads& loads, const FitParameter& parameter, int axis) {
    if (parameter.kind == TissueParameter::PoissonsRatio) return poissons_ratio(prepared, parameter);
    if (parameter.kind == TissueParameter::StiffnessRatio) return stiffness_ratio(prepared, parameter);
    return parameter.kind == TissueParameter::Gravity ? gravity(prepared, loads, axis) : pressure(prepared, loads);
}

}  // namespace

double FitScalar::value(double x) const {
    return kind == TissueParameter::StiffnessRatio ? given * std::exp(deviation * x) : given + deviation * x;
}

double FitScalar::slope(double x) const {
    return kind == TissueParameter::StiffnessRatio ? deviation * value(x) : deviation;
}

void FitScalar::apply(double x, Tissue& tissue) const {
    const double wanted = value(x);
    switch (kind) {
        case TissueParameter::PoissonsRatio:
            for (auto& [each, material] : tissue.materials)
                if (label == 0 || each == label) material = with_constants(material, youngs_modulus(material), wanted);
            break;
        case TissueParameter::StiffnessRatio: {
            tled::Material& material = tissue.materials.at(label);
            material =
                with_constants(material, youngs_modulus(material) * wanted / given, tled::poisson_ratio(material));
            break;
        }
        case TissueParameter::Gravity:
            tissue.loads.body_force[axis] = wanted * to_load;
            break;
        case TissueParameter::Pressure:
            tissue.loads.pressure_kpa = wanted * to_load;
            break;
    }
}

std::vector<FitScalar> fit_scalars(const PreparedModel& prepared, const TissueLoads& loads, const FitOptions& options) {
    std::vector<FitScalar> scalars;
    for (std::size_t p = 0; p < options.parameters.size(); ++p) {
        const FitParameter& parameter = options.parameters[p];
        if (!(parameter.deviation > 0) || !std::isfinite(parameter.deviation))
            throw InvalidInput("the prior of '" + name_of(parameter) + "' has the deviation " +
                               to_text(parameter.deviation) + "; a positive number is needed");
        for (std::size_t before = 0; before < p; ++before)
            if (name_of(options.parameters[before]) == name_of(parameter))
                throw InvalidInput("'" + name_of(parameter) + "' is to be fitted twice; name it once");
        const bool vector = parameter.kind == TissueParameter::Gravity;
        for (int axis = 0; axis < (vector ? 3 : 1); ++axis) {
            FitScalar scalar = scalar_of(prepared, loads, parameter, axis);
            scalar.parameter = p;
            scalar.name = name_of(parameter) + (vector ? axis_suffix[std::size_t(axis)] : "");
            scalar.kind = parameter.kind;
            scalar.label = parameter.label;
            scalar.axis = axis;
            const bool of_modulus = parameter.kind == TissueParameter::Pressure;
            scalar.deviation = parameter.deviation * (of_modulus ? stiffness_without(prepared, 0).mean() : 1.0);
            scalars.push_back(scalar);
        }
    }
    return scalars;
}

}  // namespace tissuewarp::registration::detail
