// What a scene must fulfil before anything is meshed.

#include "simulation/scene.hpp"

#include "core/errors.hpp"

#include <cmath>
#include <set>

namespace tissuewarp::simulation {
namespace {

using Eigen::Vector3d;

void require(bool holds, const std::string& message) {
    if (!holds) throw InvalidInput(message);
}

void require_positive(double value, const std::string& what) {
    require(value > 0 && std::isfinite(value), what + " is " + std::to_string(value) + "; it must be above 0");
}

void require_unit(const Vector3d& vector, const std::string& what) {
    require(std::abs(vector.norm() - 1) < 1e-6, what + " is not a unit vector");
}

void require_valid(const Region& region, const std::string& name, const Regions& sets) {
    const std::string what = "the set '" + name + "'";
    if (region.box)
        require((region.box->upper - region.box->lower).minCoeff() >= 0 && region.box->lower.allFinite() &&
                    region.box->upper.allFinite(),
                what + " has a box whose upper corner is below the lower one");
    if (region.ball) {
        require_positive(region.ball->radius, "the radius (mm) of " + what);
        require(region.ball->centre.allFinite(), what + " has a centre that is not finite");
    }
    if (region.half_space) require_unit(region.half_space->normal, "the normal of " + what);
    if (region.interface)
        require((*region.interface)[0] != (*region.interface)[1], what + " is an interface of a label with itself");
    require(!(region.interface && region.surface_of), what + " gives both surface_of and interface; give one");
    for (const std::string& other : region.without)
        require(sets.contains(other), what + " leaves out '" + other + "', which is no set of the scene");
}

/// Every set that the scene names, by what names it.
std::vector<std::pair<std::string, std::string>> named_sets(const Scene& scene) {
    std::vector<std::pair<std::string, std::string>> names;
    for (const Fixed& each : scene.fixed) names.emplace_back("what is fixed", each.set);
    for (const Motion& each : scene.motions) names.emplace_back("a motion", each.set);
    for (const Springs& each : scene.springs) names.emplace_back("springs", each.set);
    for (const Pressure& each : scene.pressures) names.emplace_back("a pressure", each.set);
    for (const Traction& each : scene.tractions) names.emplace_back("a traction", each.set);
    for (const MembraneOn& each : scene.membranes) names.emplace_back("a membrane", each.set);
    for (const Resection& each : scene.resections) names.emplace_back("a resection", each.set);
    for (const Contact& each : scene.contacts)
        if (!each.set.empty()) names.emplace_back("a contact", each.set);
    for (const Sliding& each : scene.sliding)
        if (!each.except.empty()) names.emplace_back("a sliding interface", each.except);
    for (const Sliding& each : scene.sliding)
        if (each.sets)
            for (const std::string& set : *each.sets) names.emplace_back("a sliding interface", set);
    return names;
}

void require_finite(const RigidMotion& motion, const std::string& what) {
    require(motion.displacement.allFinite() && motion.turn.allFinite() && motion.point.allFinite(),
            what + " has a displacement or a rotation that is not finite");
}

void require_loads(const Scene& scene) {
    for (const Motion& motion : scene.motions) {
        require_finite(motion.motion, "a motion of '" + motion.set + "'");
        require_valid(motion.curve, "the curve of a motion");
    }
    for (const Springs& springs : scene.springs)
        require((springs.per_area > 0) != (springs.total > 0) && springs.per_area >= 0 && springs.total >= 0,
                "springs on '" + springs.set + "' need a stiffness per area or in all, above 0, and not both");
    for (const Pressure& pressure : scene.pressures) {
        require(std::isfinite(pressure.pressure), "the pressure on '" + pressure.set + "' is not finite");
        require_valid(pressure.curve, "the curve of a pressure");
    }
    for (const Traction& traction : scene.tractions) {
        require(traction.traction.allFinite(), "the traction on '" + traction.set + "' is not finite");
        require_valid(traction.curve, "the curve of a traction");
    }
    for (const MembraneOn& membrane : scene.membranes) {
        require_positive(membrane.shear_modulus, "the shear modulus (kPa) of the membrane on '" + membrane.set + "'");
        require_positive(membrane.thickness, "the thickness (mm) of the membrane on '" + membrane.set + "'");
    }
    if (scene.gravity) {
        require_unit(scene.gravity->to, "the direction of gravity");
        if (scene.gravity->from) require_unit(*scene.gravity->from, "the direction of gravity in the image");
        require_positive(scene.gravity->magnitude, "gravity (mm/s²)");
        require_valid(scene.gravity->curve, "the curve of gravity");
    }
    if (!scene.fluid) return;
    require(scene.gravity && scene.gravity->from,
            "a fluid lifts against gravity: the scene needs a gravity with the direction 'from' that the image shows");
    require_positive(scene.fluid->density, "the density (kg/mm³) of the fluid");
    require(std::isfinite(scene.fluid->from) && std::isfinite(scene.fluid->to), "a level of the fluid is not finite");
    require_valid(scene.fluid->curve, "the curve of the fluid's level");
}

void require_neighbours(const Scene& scene) {
    for (const Contact& contact : scene.contacts) {
        require(contact.friction >= 0 && std::isfinite(contact.friction), "the friction of a contact is below 0");
        require(std::isfinite(contact.gap), "the gap (mm) of a contact is not finite");
        require_finite(contact.motion, "a contact");
        require_valid(contact.curve, "the curve of a contact");
        if (const auto* plane = std::get_if<HalfSpace>(&contact.body))
            require_unit(plane->normal, "the normal of a plane in contact");
        if (const auto* ball = std::get_if<Ball>(&contact.body))
            require_positive(ball->radius, "the radius (mm) of a ball in contact");
        if (const auto* body = std::get_if<ObstacleLabel>(&contact.body))
            require(!scene.tissues.contains(body->label),
                    "label " + std::to_string(body->label) +
                        " is a body in contact and has a tissue; it is one or the other");
    }
    for (const Sliding& sliding : scene.sliding) {
        require_positive(sliding.per_area, "the stiffness (kPa/mm) of a sliding interface");
        if (sliding.sets) {
            require((*sliding.sets)[0] != (*sliding.sets)[1],
                    "the set '" + (*sliding.sets)[0] + "' cannot slide on itself");
            continue;
        }
        for (const int label : sliding.labels)
            require(scene.tissues.contains(label), "label " + std::to_string(label) +
                                                       " slides and has no tissue; add [label." +
                                                       std::to_string(label) + "]");
        require(sliding.labels[0] != sliding.labels[1], "a label cannot slide on itself");
    }
}

void require_valid(const Solve& solve, const Scene& scene) {
    require_positive(solve.duration, "the duration (s) of the scene");
    require_positive(solve.tolerance_mm, "the tolerance (mm) of the scene");
    require(solve.frames >= 1, "a scene needs one frame at least");
    require(solve.damping >= 0 && std::isfinite(solve.damping), "the damping (1/s) is below 0");
    require(solve.step >= 0 && std::isfinite(solve.step), "the time step (s) is below 0");
    for (const Resection& resection : scene.resections)
        require(resection.time > 0 && resection.time <= solve.duration,
                "the resection of '" + resection.set + "' at " + std::to_string(resection.time) +
                    " s is not within the scene's " + std::to_string(solve.duration) + " s");
}

}  // namespace

std::string sides_of(const Sliding& sliding) {
    if (sliding.sets) return "the sets '" + (*sliding.sets)[0] + "' and '" + (*sliding.sets)[1] + "'";
    return "labels " + std::to_string(sliding.labels[0]) + " and " + std::to_string(sliding.labels[1]);
}

void require_valid(const Scene& scene) {
    require(!scene.tissues.empty(), "the scene has no tissue; give each label a material");
    for (const auto& [label, tissue] : scene.tissues) {
        const std::string name = "label " + std::to_string(label);
        require(label > 0, name + " is none of a tissue; labels are above 0");
        tled::require_valid(tissue.material, name);
        tled::require_valid(tissue.viscosity, name);
        require(tissue.growth > 0.2 && tissue.growth < 5,
                "the growth of " + name + " is " + std::to_string(tissue.growth) + "; it lies between 0.2 and 5");
        if (std::holds_alternative<std::monostate>(tissue.fibres)) continue;
        require(std::holds_alternative<tled::TransverselyIsotropic>(tissue.material),
                name + " has fibres and the law " + tled::law_name(tissue.material) +
                    ", which knows none; take transversely-isotropic");
    }
    require_positive(scene.density, "the density (kg/mm³) of the tissue");
    for (const auto& [name, region] : scene.sets) require_valid(region, name, scene.sets);
    for (const auto& [what, set] : named_sets(scene))
        require(scene.sets.contains(set), what + " names '" + set + "', which is no set of the scene");
    require_loads(scene);
    require_neighbours(scene);
    require_valid(scene.solve, scene);
    std::set<std::string> probes;
    for (const Probe& probe : scene.probes)
        require(probes.insert(probe.name).second, "two probes are named '" + probe.name + "'");
}

}  // namespace tissuewarp::simulation
