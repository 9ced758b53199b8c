#include "tests/verification/effect_cases.hpp"

#include "meshing/primitives.hpp"
#include "tests/verification/effect_column.hpp"
#include "tled/equilibrium.hpp"
#include "tled/growth.hpp"
#include "tled/model/internal_force.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::verification {
namespace {

using namespace effects;
using Eigen::Matrix3Xd;
using Eigen::Matrix3Xi;
using Eigen::Vector3d;
using tled::Conditions;
using tled::Model;
using tled::RestState;

double measured_sag(const MakeEngine& make) {
    const Model model = column(50);
    Conditions conditions;
    guide(model, true, conditions);
    conditions.external_force = weight(tled::rest_state(model), {0, 0, -gravity});
    return mean(model, settle(model, conditions, make), 2, on_top);
}

// Gravity that has turned sideways on a layer that can only shear: τ = μ γ, so that u = ρ g (L X − X²/2)/μ.
double measured_shear(const MakeEngine& make) {
    const Model model = column(50);
    Conditions conditions;
    for (int a = 0; a < model.mesh.node_count(); ++a)
        conditions.prescribed.push_back({a, {model.mesh.nodes(2, a) < 1e-9, true, true}, {0, 0, 0}});
    conditions.external_force = weight(tled::rest_state(model), {0.2 * gravity, 0, 0});
    return mean(model, settle(model, conditions, make), 0, on_top);
}

// Fluid of 0.9 of the tissue's density up to a level of 60 mm: below the section X_h that comes to lie there, the
// tissue weighs a tenth.
constexpr double level = 60.0, lift = 0.9;
double sag_in_fluid() {
    const auto stress = [](double wet) {
        return [wet](double X) {
            return -density * gravity * ((length - std::max(X, wet)) + (1 - lift) * std::max(0.0, wet - X));
        };
    };
    double low = level, high = length;
    for (int i = 0; i < 60; ++i) {
        const double wet = 0.5 * (low + high);
        (deformed_length(stress(wet), 0, wet) < level ? low : high) = wet;
    }
    const double wet = 0.5 * (low + high);
    return deformed_length(stress(wet), 0, wet) + deformed_length(stress(wet), wet, length) - length;
}
double measured_sag_in_fluid(const MakeEngine& make) {
    const Model model = column(50);
    Conditions conditions;
    guide(model, true, conditions);
    conditions.external_force = weight(tled::rest_state(model), {0, 0, -gravity});
    conditions.effects.fluid = tled::Fluid{lift * density, {0, 0, -gravity}, level};
    return mean(model, settle(model, conditions, make), 2, on_top);
}

// Elastic foundation of s = 0.05 kPa/mm under a column pressed by 0.5 kPa: −p/s at the base, λ(−p) above it.
constexpr double foundation = 0.05, dead_load = 0.5;
double foundation_shortening() {
    return -dead_load / foundation + (column_stretch(-dead_load) - 1) * length;
}
double measured_foundation_shortening(const MakeEngine& make) {
    const Model model = column(10);
    Conditions conditions;
    guide(model, false, conditions);
    conditions.external_force = Matrix3Xd::Zero(3, model.mesh.node_count());
    for (const meshing::InterfaceFace& face : meshing::interface_faces(model.mesh)) {
        const auto is_at = [&](double z) {
            return std::all_of(face.nodes.begin(), face.nodes.end(),
                               [&](int a) { return std::abs(model.mesh.nodes(2, a) - z) < 1e-9; });
        };
        const double third = side * side / 2 / 3;
        for (const int a : face.nodes) {
            if (is_at(0))
                conditions.springs.push_back(
                    {a, third * foundation * Vector3d::UnitZ() * Vector3d::UnitZ().transpose(), {0, 0, 0}});
            if (is_at(length)) conditions.external_force(2, a) -= third * dead_load;
        }
    }
    return mean(model, settle(model, conditions, make), 2, on_top);
}

// An eighth of a thick shell of nearly incompressible neo-Hookean material, A ≤ R ≤ B, inflated from inside: with the
// stretches λ_A = a/A and λ_B = b/B of the incompressible shell, b³ − a³ = B³ − A³,
// p = μ/2 (4/λ_B + 1/λ_B⁴ − 4/λ_A − 1/λ_A⁴) (Green and Zerna 1968, section 3.10).
constexpr double shell_inner = 20.0, shell_outer = 30.0, shell_stretch = 1.3, shell_modulus = 1.0;
double shell_pressure() {
    const double a = shell_stretch * shell_inner;
    const double b = std::cbrt(std::pow(a, 3) + std::pow(shell_outer, 3) - std::pow(shell_inner, 3));
    const auto part = [](double stretch) { return 4 / stretch + 1 / std::pow(stretch, 4); };
    return 0.5 * shell_modulus * (part(b / shell_outer) - part(shell_stretch));
}
Model shell(int cells) {
    Model model;
    model.mesh = meshing::box_mesh({1, 1, 1}, {cells, cells, cells / 2});
    for (auto X : model.mesh.nodes.colwise()) {
        // The unit square to an octant of the sphere by equal angles: u and v turn about y and x.
        const Vector3d ray = Vector3d(std::tan(M_PI / 4 * X[0]), std::tan(M_PI / 4 * X[1]), 1).normalized();
        X = (shell_inner + (shell_outer - shell_inner) * X[2]) * ray;
    }
    model.materials = {{1, tled::NeoHookeanIso{shell_modulus, 500 * shell_modulus}}};
    model.element = tled::Element::AveragedPressureT4;
    model.density = density;
    return model;
}
/// A part of the shell between the planes x = 0, y = 0, x = z and y = z, which by symmetry are not crossed.
double measured_shell_radius(const MakeEngine& make) {
    const Model model = shell(12);
    Conditions conditions;
    const Matrix3Xd& X = model.mesh.nodes;
    const double stiff = 1e4;
    Matrix3Xi inside(3, 0);
    for (const meshing::InterfaceFace& face : meshing::interface_faces(model.mesh))
        if (std::all_of(face.nodes.begin(), face.nodes.end(),
                        [&](int a) { return X.col(a).norm() < shell_inner * (1 + 1e-9); })) {
            inside.conservativeResize(3, inside.cols() + 1);
            inside.rightCols(1) << face.nodes[0], face.nodes[1], face.nodes[2];
        }
    for (int a = 0; a < X.cols(); ++a)
        for (const Vector3d& n : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(1, 0, -1), Vector3d(0, 1, -1)})
            if (std::abs(n.dot(X.col(a))) < 1e-6)
                conditions.springs.push_back({a, stiff * n * n.transpose(), {0, 0, 0}});
    conditions.effects.pressures.push_back({inside, shell_pressure()});
    constexpr double tolerance_mm = 0.01;  // forces of float32 end at some micrometres of so soft a shell
    const Matrix3Xd u = settle(model, conditions, make, tolerance_mm);
    double sum = 0;
    int count = 0;
    for (int a = 0; a < X.cols(); ++a)
        if (X.col(a).norm() < shell_inner * (1 + 1e-9)) {
            sum += (X.col(a) + u.col(a)).norm();
            ++count;
        }
    return sum / count;
}

// A block of 20 mm between two plates, drawn out by 1.3, with sheets on its four free sides: block and sheets stretch
// alike, each with μ (λ − λ⁻²) over its section.
constexpr double block_side = 20.0, block_stretch = 1.3, sheet_modulus = 30.0, sheet_thickness = 0.2;
double block_force() {
    const double tension = block_stretch - 1 / (block_stretch * block_stretch);
    return tension * (block_side * block_side * 1.0 + 4 * block_side * sheet_thickness * sheet_modulus);
}
double measured_block_force(const MakeEngine& make) {
    Model model;
    model.mesh = meshing::box_mesh({block_side, block_side, block_side}, {4, 4, 4});
    model.materials = {{1, tled::NeoHookeanIso{1.0, 2000.0}}};
    model.element = tled::Element::AveragedPressureT4;
    model.density = density;
    const Matrix3Xd& X = model.mesh.nodes;
    Conditions conditions;
    for (int a = 0; a < X.cols(); ++a) {
        const bool top = X(2, a) > block_side - 1e-9;
        conditions.prescribed.push_back({a,
                                         {X(0, a) < 1e-9, X(1, a) < 1e-9, X(2, a) < 1e-9 || top},
                                         {0, 0, top ? (block_stretch - 1) * block_side : 0.0}});
    }
    Matrix3Xi sides(3, 0);
    for (const meshing::InterfaceFace& face : meshing::interface_faces(model.mesh)) {
        const auto flat = [&](double z) {
            return std::all_of(face.nodes.begin(), face.nodes.end(),
                               [&](int a) { return std::abs(X(2, a) - z) < 1e-9; });
        };
        if (flat(0) || flat(block_side)) continue;
        sides.conservativeResize(3, sides.cols() + 1);
        sides.rightCols(1) << face.nodes[0], face.nodes[1], face.nodes[2];
    }
    conditions.effects.membranes.push_back({sides, sheet_modulus, sheet_thickness});
    const RestState rest = tled::rest_state(model);
    const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest);
    const auto engine = make(rest);
    const Matrix3Xd u =
        tled::equilibrium(*engine, tled::RestStiffness(rest, nodal), nodal, {.tolerance_mm = 1e-4}).displacement;
    const Matrix3Xd force = engine->internal_force() - tled::surface_force(nodal.effects.surface, rest.position, u);
    double sum = 0;
    for (int a = 0; a < X.cols(); ++a)
        if (X(2, a) > block_side - 1e-9) sum += force(2, a);
    return sum;
}

// Two columns, one on the other, that slide: moving the lower sideways by 5 mm leaves the upper where springs hold it.
struct Stacked {
    Model model;
    std::vector<tled::SlidingPair> pairs;
    int first_upper = 0;
};
Stacked stacked(int cells) {
    Stacked s;
    s.model = column(cells);
    meshing::TetMesh& lower = s.model.mesh;
    s.first_upper = lower.node_count();
    const int tets = lower.tet_count();
    Matrix3Xd nodes(3, 2 * s.first_upper);
    nodes << lower.nodes, lower.nodes.colwise() + Vector3d(0, 0, length);
    Eigen::Matrix4Xi both(4, 2 * tets);
    both << lower.tets, lower.tets.array() + s.first_upper;
    lower.nodes = nodes;
    lower.tets = both;
    lower.labels = Eigen::VectorXi::Constant(2 * tets, 1);
    for (int a = 0; a < s.first_upper; ++a)
        for (int b = s.first_upper; b < 2 * s.first_upper; ++b)
            if ((nodes.col(a) - nodes.col(b)).norm() < 1e-9) s.pairs.push_back({a, b, Vector3d::UnitZ(), 1e4});
    return s;
}
Matrix3Xd slid(const Stacked& s, const MakeEngine& make) {
    Conditions conditions;
    const Matrix3Xd& X = s.model.mesh.nodes;
    for (int a = 0; a < X.cols(); ++a) {
        const bool lower = a<s.first_upper, top = X(2, a)> 2 * length - 1e-9;
        conditions.prescribed.push_back(
            {a, {lower, true, X(2, a) < 1e-9 || top}, {lower ? 5.0 : 0.0, 0, top ? -20.0 : 0.0}});
        if (!lower)
            conditions.springs.push_back({a, 0.01 * Vector3d::UnitX() * Vector3d::UnitX().transpose(), {0, 0, 0}});
    }
    conditions.effects.sliding = s.pairs;
    return settle(s.model, conditions, make);
}
double measured_slip(const MakeEngine& make) {
    const Stacked s = stacked(5);
    const Matrix3Xd u = slid(s, make);
    return u.row(0).tail(u.cols() - s.first_upper).mean();
}
double measured_share_of_lower(const MakeEngine& make) {
    const Stacked s = stacked(5);
    // Sideways the upper column gives way and the lower does not: both are measured by the force that they pass on.
    const RestState rest = tled::rest_state(s.model);
    const Matrix3Xd force = tled::internal_force(rest, slid(s, make));
    double base = 0, top = 0;
    for (int a = 0; a < s.model.mesh.node_count(); ++a) {
        if (s.model.mesh.nodes(2, a) < 1e-9) base += force(2, a);
        if (s.model.mesh.nodes(2, a) > 2 * length - 1e-9) top += force(2, a);
    }
    return -base / top;
}

// Growth by g = 1.2 of a block between walls that do not give: F is I and the tissue's own F is I/g, so that the walls
// carry p = κ (1 − g⁻³) (J's part; the isochoric part of I/g is none).
constexpr double growth = 1.2;
Model grown_block(std::vector<tled::SurfacePressure>& pressures) {
    Model model;
    model.mesh = meshing::box_mesh({10, 10, 10}, {3, 3, 3}, 0.1, 5);
    model.materials = {{1, tled::neo_hookean_iso(modulus, poisson)}};
    model.element = tled::Element::T4;
    model.density = density;
    tled::Grown grown = tled::grown(model, {{1, growth}});
    pressures = grown.pressures;
    return grown.model;
}
double measured_wall_pressure(const MakeEngine& make) {
    Conditions conditions;
    const Model model = grown_block(conditions.effects.pressures);
    for (int a = 0; a < model.mesh.node_count(); ++a)
        conditions.prescribed.push_back({a, {true, true, true}, {0, 0, 0}});
    const RestState rest = tled::rest_state(model);
    const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest);
    const auto engine = make(rest);
    engine->set_conditions(nodal);
    const Matrix3Xd still = Matrix3Xd::Zero(3, rest.node_count);
    const Matrix3Xd on_walls =
        tled::surface_force(nodal.effects.surface, rest.position, still) - engine->internal_force();
    double sum = 0;
    for (int a = 0; a < rest.node_count; ++a)
        if (model.mesh.nodes(2, a) > 10 - 1e-9) sum += on_walls(2, a);
    return sum / 100;
}
double measured_free_growth(const MakeEngine& make) {
    Conditions conditions;
    const Model model = grown_block(conditions.effects.pressures);
    const Matrix3Xd& X = model.mesh.nodes;
    for (int a = 0; a < X.cols(); ++a)
        conditions.prescribed.push_back({a, {X(0, a) < 1e-9, X(1, a) < 1e-9, X(2, a) < 1e-9}, {0, 0, 0}});
    const Matrix3Xd u = settle(model, conditions, make);
    return (u - (growth - 1) * X).colwise().norm().maxCoeff();
}

// A cube whose whole boundary moves by F, so that the stress is one number: of fibres along z drawn out to λ at
// constant volume, P_zz = μ (λ − I₁/(3 λ)) + 4/3 η (λ² − 1) λ with I₁ = λ² + 2/λ; of a viscous law sheared and held,
// the part 1 − g (1 − exp(−t/τ)) that is left.
Model cube_of(const tled::Material& law) {
    Model model;
    model.mesh = meshing::box_mesh({10, 10, 10}, {2, 2, 2});
    model.materials = {{1, law}};
    model.element = tled::Element::T4;
    model.density = density;
    return model;
}
tled::NodalConditions moved_by(const Eigen::Matrix3d& F, const RestState& rest) {
    Conditions conditions;
    for (int a = 0; a < rest.node_count; ++a)
        conditions.prescribed.push_back(
            {a, {true, true, true}, (F - Eigen::Matrix3d::Identity()) * rest.position.col(a)});
    return tled::nodal_conditions(conditions, rest);
}
double stress_on_top(tled::Engine& engine, const RestState& rest, int component) {
    const Matrix3Xd force = engine.internal_force();
    double sum = 0;
    for (int a = 0; a < rest.node_count; ++a)
        if (rest.position(2, a) > 10 - 1e-9) sum += force(component, a);
    return sum / 100;
}
constexpr double fibre_stretch = 1.2, fibre_modulus = 4.0;
double fibre_stress() {
    const double first_invariant = fibre_stretch * fibre_stretch + 2 / fibre_stretch;
    return fibre_stretch - first_invariant / (3 * fibre_stretch) +
           4.0 / 3 * fibre_modulus * (fibre_stretch * fibre_stretch - 1) * fibre_stretch;
}
double measured_fibre_stress(const MakeEngine& make) {
    const Model model = cube_of(tled::TransverselyIsotropic{1.0, 50.0, fibre_modulus, Vector3d::UnitZ()});
    const RestState rest = tled::rest_state(model);
    const double across = 1 / std::sqrt(fibre_stretch);
    const auto engine = make(rest);
    engine->set_conditions(moved_by(Vector3d(across, across, fibre_stretch).asDiagonal(), rest));
    return stress_on_top(*engine, rest, 2);
}
constexpr double relaxing_part = 0.5, relaxation_time = 0.1;
double measured_relaxation(const MakeEngine& make) {
    Model model = cube_of(tled::NeoHookeanIso{1.0, 50.0});
    model.viscosity = {{1, {{{relaxing_part, relaxation_time}}}}};
    const RestState rest = tled::rest_state(model);
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    F(0, 2) = 0.1;
    const auto engine = make(rest);
    engine->set_conditions(moved_by(F, rest));
    const double at_once = stress_on_top(*engine, rest, 0);
    constexpr int steps = 400;
    engine->run(steps, {0, 0, relaxation_time / steps});
    return stress_on_top(*engine, rest, 0) / at_once;
}

}  // namespace

std::vector<EffectCase> effect_cases() {
    const auto shear = tled::neo_hookean_iso(modulus, poisson).shear_modulus;
    std::vector<EffectCase> cases{
        {"gravity", "column under its weight", "sag of the top", "mm", "quadrature of P(λ(X)) = −ρ g (L − X)",
         sag_of_column(), 0.01, measured_sag},
        {"gravity, turned", "layer that shears", "shift of the top", "mm", "ρ g L²/(2 μ)",
         0.2 * density * gravity * length * length / (2 * shear), 0.01, measured_shear},
        {"fluid level", "column in fluid up to 60 mm", "sag of the top", "mm",
         "quadrature, lighter below the deformed level", sag_in_fluid(), 0.02, measured_sag_in_fluid},
        {"elastic foundation", "column pressed onto springs", "shift of the top", "mm", "−p/s + (λ(−p) − 1) L",
         foundation_shortening(), 2e-3, measured_foundation_shortening},
        {"pressure", "thick shell inflated by 1.3", "inner radius", "mm", "Green and Zerna 1968",
         shell_stretch * shell_inner, 0.1, measured_shell_radius},
        {"membrane", "block in four sheets, drawn out", "force", "mN", "μ (λ − λ⁻²) over the section", block_force(),
         0.5, measured_block_force},
        {"sliding", "two columns, the lower moved aside", "shift of the upper", "mm", "none passes", 0.0, 2e-3,
         measured_slip},
        {"sliding", "two columns, the upper pressed", "force below over above", "1", "all passes", 1.0, 1e-3,
         measured_share_of_lower},
        {"growth", "block that grows by 1.2 between walls", "pressure on the walls", "kPa", "κ (1 − g⁻³)",
         tled::neo_hookean_iso(modulus, poisson).bulk_modulus * (1 - std::pow(growth, -3)), 1e-5,
         measured_wall_pressure},
        {"growth", "block that grows by 1.2", "largest distance from (g − 1) X", "mm", "exact on any mesh", 0.0, 2e-3,
         measured_free_growth},
        {"fibres", "cube drawn out along them", "stress", "kPa", "4/3 η (λ² − 1) λ and the matrix", fibre_stress(),
         1e-4, measured_fibre_stress},
        {"viscosity", "cube sheared and held for τ", "part that is left", "1", "1 − g (1 − 1/e)",
         1 - relaxing_part * (1 - std::exp(-1.0)), 2e-3, measured_relaxation},
    };
    const std::vector<EffectCase> more = contact_cases();
    cases.insert(cases.end(), more.begin(), more.end());
    return cases;
}

}  // namespace tissuewarp::verification
