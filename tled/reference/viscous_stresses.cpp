#include "tled/reference/viscous_stresses.hpp"

#include "tled/model/kinematics.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/LU>

#include <cmath>

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;

ViscousStresses unstressed(const RestState& rest) {
    ViscousStresses stresses(rest.tet.size());
    if (rest.viscosity.empty()) return stresses;
    for (const MaterialBlock& block : rest.blocks)
        for (int e = block.begin; e < block.end; ++e)
            stresses[e].assign(rest.viscosity[block.material].terms.size(), Matrix3d::Zero());
    return stresses;
}

ViscousStresses advanced(const RestState& rest, ViscousStresses stresses, const Matrix3Xd& displacement,
                         double interval) {
    if (rest.viscosity.empty()) return stresses;
    const std::vector<int> material_of = material_of_elements(rest);
    parallel_for(0, rest.element_count(), [&](int e) {
        const std::vector<PronyTerm>& terms = rest.viscosity[material_of[e]].terms;
        if (terms.empty()) return;
        const Matrix3d F = detail::deformation_gradient(rest, displacement, e);
        const Matrix3d S = F.inverse() * shear_stress(detail::element_material(rest, material_of[e], e), F);
        for (std::size_t k = 0; k < terms.size(); ++k) {
            const auto [g, tau] = terms[k];
            Matrix3d& q = stresses[e][k];
            q = -g * std::expm1(-interval / tau) * S + std::exp(-interval / tau) * q;
        }
    });
    return stresses;
}

}  // namespace tissuewarp::tled
