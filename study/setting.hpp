#pragma once
/// One way to solve a problem: mesh, element, tissue, solver, tolerance and machine.

#include "tled/engine.hpp"
#include "tled/equilibrium.hpp"
#include "tled/material.hpp"

#include <array>
#include <string>

namespace tissuewarp::study {

enum class Law {
    Linear,  ///< the answer at small strain, K₀ u = f, in one triangular solve; in registrations one such step a round
    LnJ,     ///< neo-Hookean with ln J, and so on as tled/material.hpp says
    Iso,
    Stable,
    MooneyRivlin,  ///< c10 = c01
    Ogden          ///< one term, α = −4.7: brain tissue (Miller and Chinzei, J. Biomech. 35 (2002) 483)
};

enum class Solver { Automatic, Lbfgs, DynamicRelaxation, SelfCheckedRelaxation, Newton };

enum class Hold {
    Hard,  ///< imposed displacements; in registrations springs of the data ten times stiffer than by default
    Soft   ///< springs
};

/// What decides the exact answer: settings that differ in nothing else converge to the same displacement.
struct Physics {
    Law law = Law::LnJ;
    double poissons_ratio = 0.49;
    Hold hold = Hold::Hard;
    bool operator==(const Physics&) const = default;
};

struct Setting {
    int elements = 20000;  ///< wanted; the mesh comes near
    tled::Element element = tled::Element::AveragedPressureT4;
    Physics physics;
    Solver solver = Solver::Automatic;
    double tolerance_mm = 0.05;
    tled::Scalar arithmetic = tled::Scalar::Float32;  ///< of the processor; a GPU computes in float32
    tled::Processor processor = tled::Processor::Cpu;
    bool operator==(const Setting&) const = default;
};

inline constexpr std::array every_element{tled::Element::T4, tled::Element::AveragedPressureT4};
inline constexpr std::array every_law{Law::Linear, Law::LnJ, Law::Iso, Law::Stable, Law::MooneyRivlin, Law::Ogden};
inline constexpr std::array every_solver{Solver::Automatic, Solver::Lbfgs, Solver::DynamicRelaxation,
                                         Solver::SelfCheckedRelaxation, Solver::Newton};

/// Names of files and of people: "averaged pressure", "neo-Hookean, ln J", "L-BFGS", …
std::string name_of(tled::Element element);
std::string name_of(Law law);
std::string name_of(Solver solver);
std::string name_of(Hold hold);
std::string name_of(tled::Scalar scalar);
std::string name_of(tled::Processor processor);

/// Inverse of name_of. Throws InvalidInput for a text that names nothing of the kind.
tled::Element element_named(const std::string& name);
Law law_named(const std::string& name);
Solver solver_named(const std::string& name);
Hold hold_named(const std::string& name);
tled::Scalar scalar_named(const std::string& name);
tled::Processor processor_named(const std::string& name);

/// Tissue of Young's modulus 3 kPa; the linear law takes the tangent at rest of the neo-Hookean one.
tled::Material material_of(const Physics& physics);
/// Throws std::logic_error for Newton's method, which is no method of tled::equilibrium.
tled::EquilibriumMethod method_of(Solver solver);

/// "20 000 averaged pressure, ln J, ν 0.49, automatic, 0.05 mm, float32, CPU, hard": for progress, notes and messages.
std::string words_of(const Setting& setting);

}  // namespace tissuewarp::study
