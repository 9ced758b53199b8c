#pragma once
/// The scenes of the engines' tests, and the step in plain float64.

#include "meshing/primitives.hpp"
#include "tled/engine.hpp"
#include "tled/material/stress_clock.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/reference/viscous_stresses.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::tled::scene {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// Every engine takes the same tests: the GPU's as it comes, which on a software rasteriser takes two passes, and with
/// its steps over patches, which is what hardware takes.
enum class Kind { CpuFloat64, CpuFloat32, Gpu, GpuPatches };

constexpr GpuStepShape small_patches{.patch_tets = 100, .longest_fan = 5, .workgroup = 64};

inline std::unique_ptr<Engine> make_engine(Kind kind, const RestState& rest) {
    if (kind == Kind::Gpu) return make_gpu_engine(rest);
    if (kind == Kind::GpuPatches) return make_gpu_engine(rest, -1, small_patches);
    return make_cpu_engine(rest, kind == Kind::CpuFloat64 ? Scalar::Float64 : Scalar::Float32);
}

inline const char* name_of(Kind kind) {
    constexpr const char* names[] = {"CpuFloat64", "CpuFloat32", "Gpu", "GpuPatches"};
    return names[static_cast<int>(kind)];
}

enum class Laws { Iso, LnJ, Stable, Polynomial, ArrudaBoyce, Ogden, Fibres, TwoFibres, Mixed };

inline const char* name_of(Laws laws) {
    constexpr const char* names[] = {"Iso",   "LnJ",    "Stable",    "Polynomial", "ArrudaBoyce",
                                     "Ogden", "Fibres", "TwoFibres", "Mixed"};
    return names[static_cast<int>(laws)];
}

/// Two materials of a law, shear moduli of 1 to 3 kPa.
inline std::array<Material, 2> materials_of(Laws laws) {
    const NeoHookeanLnJ soft_lnj{1.007, 49.329};
    const Vector3d fibre = Vector3d(1, 2, -0.5).normalized();
    switch (laws) {
        case Laws::Iso:
            return {NeoHookeanIso{1.007, 50.0}, NeoHookeanIso{2.5, 30.0}};
        case Laws::LnJ:
            return {soft_lnj, NeoHookeanLnJ{3.0, 20.0}};
        case Laws::Stable:
            return {NeoHookeanStable{1.007, 49.329}, NeoHookeanStable{3.0, 20.0}};
        case Laws::Polynomial:
            return {tled::Polynomial{0.3, 0.15, 0.08, 0.06, 0.04, 0.02, 50.0}, mooney_rivlin(0.8, 0.4, 30.0)};
        case Laws::ArrudaBoyce:
            return {tled::ArrudaBoyce{1.007, 1.1, 50.0}, tled::ArrudaBoyce{2.0, 1.5, 30.0}};
        case Laws::Ogden:
            return {tled::Ogden{{OgdenTerm{0.8, 2.5}, OgdenTerm{-0.3, -3.0}, OgdenTerm{0.05, 8.0}}, 50.0},
                    tled::Ogden{{OgdenTerm{2.5, 2.0}}, 30.0}};
        case Laws::Fibres:
            return {TransverselyIsotropic{1.007, 50.0, 2.0, fibre}, NeoHookeanIso{2.5, 30.0}};
        case Laws::TwoFibres:
            return {TransverselyIsotropic{1.007, 50.0, 2.0, fibre}, TransverselyIsotropic{2.5, 30.0, 1.0, -fibre}};
        case Laws::Mixed:
            return {soft_lnj, NeoHookeanIso{2.5, 30.0}};
    }
    return {};
}

inline const char* name_of(Element element) {
    return element == Element::T4 ? "T4" : "AveragedPressure";
}

/// A jittered cube of 30 mm, label 1 in front and 2 behind a diagonal plane, so that blocks and pressure nodes mix.
inline Model cube(int edge_cells, Element element, Laws laws) {
    Model model;
    model.mesh = meshing::box_mesh({30, 30, 30}, {edge_cells, edge_cells, edge_cells}, 0.1, 3);
    for (int t = 0; t < model.mesh.tet_count(); ++t) {
        double sum = 0;  // x + y of the centre
        for (const int node : model.mesh.tets.col(t)) sum += model.mesh.nodes.col(node).head<2>().sum() / 4;
        model.mesh.labels[t] = sum < 27.5 ? 1 : 2;
    }
    const std::array<Material, 2> materials = materials_of(laws);
    model.materials = {{1, materials[0]}, {2, materials[1]}};
    model.element = element;
    return model;
}

/// Smooth, with strains of about 10 %; mm.
inline Matrix3Xd wavy(const Matrix3Xd& X, double amplitude = 1.0) {
    Matrix3Xd u(3, X.cols());
    for (Eigen::Index i = 0; i < X.cols(); ++i)
        u.col(i) = amplitude * Vector3d(std::sin(0.11 * X(1, i) + 0.05 * X(2, i)), 0.8 * std::cos(0.13 * X(0, i)),
                                        0.7 * std::sin(0.1 * X(0, i) - 0.08 * X(2, i)));
    return u;
}

/// The bottom held, the top's x and z imposed, springs on two sides of which one node has two, a body force.
inline Conditions mixed_conditions(const meshing::TetMesh& mesh) {
    Conditions conditions;
    conditions.external_force = Matrix3Xd::Zero(3, mesh.node_count());
    Matrix3d stiffness;
    stiffness << 5, 1, 0.5, 1, 4, -0.3, 0.5, -0.3, 3;
    for (int node = 0; node < mesh.node_count(); ++node) {
        const Vector3d X = mesh.nodes.col(node);
        conditions.external_force.col(node) = Vector3d(0.02, -0.3, 0.1 * X.x() / 30);
        if (X.z() < 1e-9)
            conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        else if (X.z() > 30 - 1e-9)
            conditions.prescribed.push_back({node, {true, false, true}, {0.6, 0, -1.5}});
        else if (X.x() < 1e-9)
            conditions.springs.push_back({node, stiffness, {0.4, -0.2, 0.3}});
    }
    conditions.springs.push_back({conditions.springs.front().node, Matrix3d::Identity(), {1, 1, 1}});
    return conditions;
}

/// c well inside the stability bound c ω² < 4 by ω² ≤ 4 (λ + 2μ)/ρ Σ |grad N|² of an element.
inline StepCoefficients stable_coefficients(const Model& model, const RestState& rest) {
    double omega_squared = 0;
    for (int e = 0; e < rest.element_count(); ++e) {
        const int label = model.mesh.labels[rest.tet[static_cast<std::size_t>(e)]];
        const auto gradient = rest.gradient.col(e).reshaped(3, 3);
        const double sum = gradient.squaredNorm() + gradient.rowwise().sum().squaredNorm();
        omega_squared = std::max(omega_squared, 4 * p_wave_modulus(model.materials.at(label)) / model.density * sum);
    }
    return {0.98, 2 / omega_squared};
}

/// The residual of the interface's comment in plain float64.
inline Matrix3Xd plain_residual(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& u,
                                const ViscousStresses* viscous = nullptr) {
    Matrix3Xd residual =
        conditions.external_force - (viscous ? internal_force(rest, u, *viscous) : internal_force(rest, u));
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        const auto column = static_cast<Eigen::Index>(s);
        const auto k = conditions.spring_stiffness.col(column);
        Matrix3d K;
        K << k[0], k[3], k[5], k[3], k[1], k[4], k[5], k[4], k[2];
        const int node = conditions.spring_node[s];
        residual.col(node) += conditions.spring_force.col(column) - K * u.col(node);
    }
    return conditions.constrained.select(Matrix3Xd::Zero(3, rest.node_count), residual);
}

struct PlainState {
    Matrix3Xd u, v, previous_residual;
};

/// Viscous stresses of plain steps, and when they move on.
struct PlainStresses {
    explicit PlainStresses(const RestState& rest) : stresses(unstressed(rest)), clock(rest.viscosity) {}
    ViscousStresses stresses;
    detail::StressClock clock;

    void move(const RestState& rest, const Matrix3Xd& u, double time_step) {
        stresses = advanced(rest, std::move(stresses), u, clock.next(1, time_step).front().interval);
    }
    /// f_int with the stresses of the present time.
    [[nodiscard]] Matrix3Xd force(const RestState& rest, const Matrix3Xd& u) const {
        return internal_force(rest, u, advanced(rest, stresses, u, clock.lag()));
    }
};

/// The update of the interface's comment in plain float64.
inline PlainState plain_steps(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& mass,
                              Matrix3Xd u, Matrix3Xd v, int steps, const StepCoefficients& coefficients,
                              PlainStresses* viscous = nullptr) {
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    u = conditions.constrained.select(conditions.imposed, u).eval();
    v = conditions.constrained.select(zero, v).eval();
    PlainState state{u, v, zero};
    for (int step = 0; step < steps; ++step) {
        if (viscous) viscous->move(rest, state.u, coefficients.time_step);
        state.previous_residual = plain_residual(rest, conditions, state.u, viscous ? &viscous->stresses : nullptr);
        state.v =
            coefficients.momentum * state.v + coefficients.gain * state.previous_residual.cwiseQuotient(mass).eval();
        state.u += state.v;
    }
    return state;
}

inline double largest(const Matrix3Xd& vectors) {
    return vectors.cwiseAbs().maxCoeff();
}

inline Matrix3Xd lumped(const RestState& rest) {
    return rest.lumped_mass.transpose().replicate(3, 1);
}

}  // namespace tissuewarp::tled::scene
