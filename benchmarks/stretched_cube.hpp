#pragma once
/// The cube of Taylor, Cheng and Ourselin (2008) that the benchmarks of explicit steps time: edge 100 mm, ends bonded,
/// stretched by 20 % where nothing else is said, mu = 1.007 kPa, lambda = 49.329 kPa, 1000 kg/m³.

#include "meshing/tet_mesh.hpp"
#include "tled/engine.hpp"

#include <functional>
#include <string>
#include <vector>

namespace tissuewarp::stretched_cube {

inline constexpr double edge = 100;       // mm
inline constexpr double shear = 1.007;    // kPa
inline constexpr double lambda = 49.329;  // kPa
inline constexpr double default_stretch = 0.2;
inline constexpr double density = 1e-6;  // kg/mm³

/// The state in which the run begins, and what holds it.
struct Scene {
    meshing::TetMesh mesh;
    tled::NodalConditions conditions;
    Eigen::Matrix3Xd start;
};

/// Nodes within a hundredth of the height from either end are held.
Scene stretched(meshing::TetMesh mesh, double stretch = default_stretch);

/// One element and law of the tables.
struct Variant {
    std::string name;  ///< "T4 lnJ", "averaged iso"
    tled::RestState rest;
};

/// Both elements and both laws where `element` (t4, averaged) and `law` (lnj, iso) are empty.
std::vector<Variant> variants(const Scene& scene, const std::string& element, const std::string& law);

/// Tissue of one element (t4, averaged): plain neo-Hookean (iso) first, lnJ, with fibres, with one and two terms of
/// viscosity, with both. What each costs is its time over the first one's.
std::vector<Variant> tissues(const Scene& scene, const std::string& element);

/// 0.9 of the step that the element bound allows, ω² ≤ 4 (λ + 2μ)/ρ Σ |grad N|², damped by α with α Δt/2 = 0.01.
tled::StepCoefficients coefficients(const tled::RestState& rest);

/// Seconds of a steady clock.
double now();

double median(std::vector<double> values);

/// What each of `run` returns, `turns` times: all of them in turn, so that they meet the same clock and the same
/// neighbours on the machine.
std::vector<std::vector<double>> in_turn(const std::vector<std::function<double()>>& run, int turns);

}  // namespace tissuewarp::stretched_cube
