#include "tled/reference/viscous_stresses.hpp"

#include "tled/model/hexahedra.hpp"
#include "tled/model/kinematics.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/LU>

#include <cmath>

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;

ViscousStresses unstressed(const RestState& rest) {
    ViscousStresses stresses(rest.tet.size() + rest.hexahedra.hex.size());
    if (rest.viscosity.empty()) return stresses;
    const auto assign = [&](const std::vector<MaterialBlock>& blocks, int first) {
        for (const MaterialBlock& block : blocks)
            for (int e = block.begin; e < block.end; ++e)
                stresses[first + e].assign(rest.viscosity[block.material].terms.size(), Matrix3d::Zero());
    };
    assign(rest.blocks, 0);
    assign(rest.hexahedra.blocks, rest.element_count());
    return stresses;
}

ViscousStresses advanced(const RestState& rest, ViscousStresses stresses, const Matrix3Xd& displacement,
                         double interval) {
    if (rest.viscosity.empty()) return stresses;
    const auto advance = [&](std::vector<Matrix3d>& q, int material, const Material& law, const Matrix3d& F) {
        const std::vector<PronyTerm>& terms = rest.viscosity[material].terms;
        if (terms.empty()) return;
        const Matrix3d S = F.inverse() * shear_stress(law, F);
        for (std::size_t k = 0; k < terms.size(); ++k) {
            const auto [g, tau] = terms[k];
            q[k] = -g * std::expm1(-interval / tau) * S + std::exp(-interval / tau) * q[k];
        }
    };
    const std::vector<int> material_of = material_of_elements(rest);
    parallel_for(0, rest.element_count(), [&](int e) {
        advance(stresses[e], material_of[e], detail::element_material(rest, material_of[e], e),
                detail::deformation_gradient(rest, displacement, e));
    });
    const std::vector<int> material_of_hex = material_of_elements(rest.hexahedra.blocks);
    parallel_for(0, rest.hexahedra.count(), [&](int e) {
        advance(stresses[rest.element_count() + e], material_of_hex[e],
                detail::hex_material(rest, material_of_hex[e], e),
                detail::hex_deformation_gradient(rest.hexahedra, displacement, e));
    });
    return stresses;
}

}  // namespace tissuewarp::tled
