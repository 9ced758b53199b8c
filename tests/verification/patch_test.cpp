// p3: homogeneous states in closed form, from half to twice the length, of the laws and of meshes whose boundary is
// moved as they say.

#include "meshing/primitives.hpp"
#include "tests/verification/reference_file.hpp"
#include "tled/material/constitutive.hpp"
#include "tled/reference/discrete_energy.hpp"
#include "tled/reference/newton.hpp"
#include "tled/reference/quadratic.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::verification {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using nlohmann::json;

constexpr std::array groups{"uniaxial_z", "equibiaxial_xy", "simple_shear_xz", "confined_z", "general_F"};

Matrix3d matrix(const json& rows, double scale) {
    return numbers(rows, scale).reshaped<Eigen::RowMajor>(3, 3);
}

tled::Material patch_material(const json& block) {
    const double mu = kPa_per_Pa * block.at("mu").get<double>(), lambda = kPa_per_Pa * block.at("lambda").get<double>();
    const double kappa = lambda + 2.0 / 3.0 * mu;
    const auto form = block.at("form").get<std::string>();
    if (form == "iso") return tled::NeoHookeanIso{mu, kappa};
    if (form == "lnJ") return tled::NeoHookeanLnJ{mu, lambda};
    const double eta = kPa_per_Pa * block.at("eta").get<double>();  // η/2 or η/4 in front of (Ī₄ − 1)²
    return tled::TransverselyIsotropic{mu, kappa, form == "TI_half" ? eta : 0.5 * eta, numbers(block.at("a"), 1.0)};
}

// W in kPa and P in kPa, given with twelve digits; W cancels where the state is near rest.
TEST(PatchVerification, LawsMeetTheClosedForms) {
    int states = 0;
    const json file = reference_file("p3_patch");
    for (const json& block : file.at("values")) {
        const tled::Material material = patch_material(block);
        for (const char* group : groups) {
            if (!block.contains(group)) continue;
            for (const json& state : block.at(group)) {
                const Matrix3d F = matrix(state.at("F"), 1.0), P = matrix(state.at("P"), kPa_per_Pa);
                const double scale = tled::bulk_modulus(material);
                EXPECT_NEAR(tled::strain_energy(material, F), kPa_per_Pa * state.at("W").get<double>(), 1e-9 * scale);
                EXPECT_LT((tled::first_piola_kirchhoff_stress(material, F) - P).cwiseAbs().maxCoeff(), 1e-9 * scale)
                    << block.at("form") << ' ' << group << "\n"
                    << F;
                ++states;
            }
        }
    }
    EXPECT_EQ(states, 604);
}

struct Patch {
    meshing::TetMesh mesh = meshing::box_mesh({20.0, 15.0, 10.0}, {2, 2, 2}, 0.15, 4);

    static bool on_boundary(const Eigen::Vector3d& X) {
        return X.minCoeff() < 1e-9 || X[0] > 20.0 - 1e-9 || X[1] > 15.0 - 1e-9 || X[2] > 10.0 - 1e-9;
    }
    // Moves the boundary nodes in ten steps and compares all nodes and the energy.
    static void expect_homogeneous(const tled::DiscreteEnergy& energy, const Matrix3Xd& nodes, const Matrix3d& F,
                                   double density) {
        const Matrix3Xd exact = (F - Matrix3d::Identity()) * nodes;
        tled::Conditions conditions;
        for (int i = 0; i < nodes.cols(); ++i) {
            if (on_boundary(nodes.col(i))) conditions.prescribed.push_back({i, {true, true, true}, exact.col(i)});
        }
        const Matrix3Xd u =
            tled::newton_equilibrium(energy, tled::nodal_conditions(conditions, static_cast<int>(nodes.cols())),
                                     {.load_steps = 10})
                .displacement;
        EXPECT_LT((u - exact).cwiseAbs().maxCoeff(), 1e-8);              // mm
        EXPECT_NEAR(energy.energy(u), 3000.0 * density, 1e-8 * 3000.0);  // mN mm
    }
};

TEST(PatchVerification, MeshesFindTheStates) {
    const Patch patch;
    const tled::QuadraticMesh quadratic = tled::quadratic_mesh(patch.mesh);
    const json file = reference_file("p3_patch");
    for (const json& block : file.at("values")) {
        const tled::MaterialTable materials{{1, patch_material(block)}};
        for (const char* group : {"simple_shear_xz", "general_F"}) {
            const json& state = block.at(group).at(group == groups.back() ? 0 : 2);
            const Matrix3d F = matrix(state.at("F"), 1.0);
            const double density = kPa_per_Pa * state.at("W").get<double>();
            for (const tled::Element element : {tled::Element::T4, tled::Element::AveragedPressureT4}) {
                tled::Model model;
                model.mesh = patch.mesh;
                model.materials = materials;
                model.element = element;
                const tled::RestState rest = tled::rest_state(model);
                Patch::expect_homogeneous(tled::LinearTetrahedra(rest), patch.mesh.nodes, F, density);
            }
            for (const auto pressure : {tled::QuadraticPressure::Pointwise, tled::QuadraticPressure::NodalAverage}) {
                const tled::QuadraticTetrahedra elements(quadratic, materials, {.pressure = pressure});
                Patch::expect_homogeneous(elements, quadratic.nodes, F, density);
            }
        }
    }
}

}  // namespace
}  // namespace tissuewarp::verification
