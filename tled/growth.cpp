#include "tled/growth.hpp"

#include "core/errors.hpp"

#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

namespace tissuewarp::tled {
namespace {

[[noreturn]] void refuse(const Material& material, int label) {
    throw InvalidInput("label " + std::to_string(label) + " grows, and its law is " + law_name(material) +
                       ": growth needs one with an isochoric part and K/2 (J - 1)^2; take neo_hookean_iso, polynomial, "
                       "ogden or transversely_isotropic");
}

/// The law of tissue that has grown to `volume` times its own.
Material grown_law(const Material& material, double volume, int label) {
    Material result = with_shear_scaled(material, volume);
    std::visit(
        [&](auto& law) {
            using Law = std::decay_t<decltype(law)>;
            if constexpr (std::is_same_v<Law, NeoHookeanLnJ> || std::is_same_v<Law, NeoHookeanStable> ||
                          std::is_same_v<Law, ArrudaBoyce>) {
                refuse(material, label);
            } else {
                law.bulk_modulus /= volume;
            }
        },
        result);
    return result;
}

/// The surface of a label, interfaces to other labels included, outwards.
Eigen::Matrix3Xi surface_of(const std::vector<meshing::InterfaceFace>& faces, int label) {
    std::vector<int> nodes;
    for (const meshing::InterfaceFace& face : faces) {
        if (face.inner == label) nodes.insert(nodes.end(), {face.nodes[0], face.nodes[1], face.nodes[2]});
        if (face.outer == label) nodes.insert(nodes.end(), {face.nodes[0], face.nodes[2], face.nodes[1]});
    }
    return Eigen::Map<const Eigen::Matrix3Xi>(nodes.data(), 3, static_cast<Eigen::Index>(nodes.size() / 3));
}

}  // namespace

Grown grown(const Model& model, const std::map<int, double>& stretch) {
    Grown result{model, {}};
    if (stretch.empty()) return result;
    const std::vector<meshing::InterfaceFace> faces = meshing::interface_faces(model.mesh);
    for (const auto& [label, g] : stretch) {
        const auto material = result.model.materials.find(label);
        if (material == result.model.materials.end())
            throw InvalidInput("label " + std::to_string(label) + " grows and has no material");
        if (!(g > 0) || !std::isfinite(g))
            throw InvalidInput("label " + std::to_string(label) + " grows by the stretch " + std::to_string(g) +
                               "; it must be positive");
        const double volume = g * g * g;
        const double pressure = volumetric_modulus(material->second) * (1 - 1 / volume);
        material->second = grown_law(material->second, volume, label);
        Eigen::Matrix3Xi surface = surface_of(faces, label);
        if (surface.cols() == 0) throw InvalidInput("label " + std::to_string(label) + " grows and has no tetrahedra");
        result.pressures.push_back({std::move(surface), -pressure});
    }
    return result;
}

}  // namespace tissuewarp::tled
