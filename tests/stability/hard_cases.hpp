#pragma once
/// What the stability suite shares. Each case runs on every engine and ends in the right answer within a stated
/// tolerance, or in a named refusal; its comment says what a failure would look like.

#include "meshing/primitives.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/equilibrium.hpp"
#include "tled/load_path.hpp"
#include "tled/reference/newton.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <functional>

namespace tissuewarp::stability {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using tled::scene::Kind;
using tled::scene::make_engine;
using tled::scene::name_of;

/// Whether a sanitizer watches, which makes a step 10 to 100 times longer.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

/// Largest nodal distance, mm; infinite when a value is not finite.
inline double distance(const Matrix3Xd& a, const Matrix3Xd& b) {
    if (!a.allFinite() || !b.allFinite()) return std::numeric_limits<double>::infinity();
    return std::sqrt((a - b).colwise().squaredNorm().maxCoeff());
}

/// Test suites over the engines.
class OnEveryEngine : public ::testing::TestWithParam<Kind> {};
inline const auto every_engine = ::testing::Values(Kind::CpuFloat64, Kind::CpuFloat32, Kind::Gpu);
inline std::string engine_name(const ::testing::TestParamInfo<Kind>& each) {
    return name_of(each.param);
}

/// A box of one material.
inline tled::Model box(const Vector3d& size, const std::array<int, 3>& cells, const tled::Material& material,
                       tled::Element element = tled::Element::AveragedPressureT4) {
    tled::Model model;
    model.mesh = meshing::box_mesh(size, cells);
    model.materials[1] = material;
    model.element = element;
    return model;
}

/// A cube of 40 mm whose innermost node is pushed against a face of its cells, so that some tetrahedra have angles of
/// half a degree.
inline tled::Model with_slivers() {
    tled::Model model = box({40, 40, 40}, {4, 4, 4}, tled::neo_hookean_lnj(3.0, 0.45));
    Eigen::Index inner = 0;
    (model.mesh.nodes.colwise() - Vector3d(20, 20, 20)).colwise().norm().minCoeff(&inner);
    model.mesh.nodes(2, inner) += 9.93;
    return model;
}

/// Prescribes what `where` gives for a rest position: nothing, or a displacement of all components.
inline tled::NodalConditions held(const tled::Model& model,
                                  const std::function<std::optional<Vector3d>(const Vector3d&)>& where) {
    tled::Conditions conditions;
    for (int node = 0; node < model.mesh.node_count(); ++node)
        if (const auto u = where(model.mesh.nodes.col(node)))
            conditions.prescribed.push_back({node, {true, true, true}, *u});
    return tled::nodal_conditions(conditions, model.mesh.node_count());
}

/// Bottom held, top moved by `motion`.
inline tled::NodalConditions between_plates(const tled::Model& model, const Vector3d& motion) {
    const double top = model.mesh.nodes.row(2).maxCoeff(), bottom = model.mesh.nodes.row(2).minCoeff();
    return held(model, [=](const Vector3d& X) -> std::optional<Vector3d> {
        if (X.z() < bottom + 1e-9) return Vector3d::Zero();
        if (X.z() > top - 1e-9) return motion;
        return std::nullopt;
    });
}

/// Equilibrium on an engine from rest.
inline Matrix3Xd solved(Kind kind, const tled::RestState& rest, const tled::NodalConditions& conditions,
                        double tolerance_mm, const Matrix3Xd* start = nullptr) {
    const auto engine = make_engine(kind, rest);
    const tled::RestStiffness stiffness(rest, conditions);
    tled::EquilibriumOptions options;
    options.tolerance_mm = tolerance_mm;
    options.max_steps = 40000;
    options.rest = &rest;
    const auto found = tled::equilibrium(*engine, stiffness, conditions, options, start);
    EXPECT_TRUE(found.displacement.allFinite());
    EXPECT_LE(found.estimated_error_mm, tolerance_mm);
    return found.displacement;
}

inline Matrix3Xd by_newton(const tled::RestState& rest, const tled::NodalConditions& conditions, int load_steps = 1) {
    return tled::newton_equilibrium(rest, conditions, {.tolerance_mm = 1e-7, .load_steps = load_steps}).displacement;
}

/// Equilibrium by way of smaller loads.
inline Matrix3Xd solved_in_parts(Kind kind, const tled::RestState& rest, const tled::NodalConditions& conditions,
                                 double tolerance_mm, int first_parts = 1) {
    const auto engine = make_engine(kind, rest);
    const tled::RestStiffness stiffness(rest, conditions);
    tled::LoadPathOptions options;
    options.equilibrium.tolerance_mm = tolerance_mm;
    options.equilibrium.rest = &rest;
    options.first_parts = first_parts;
    const auto found = tled::equilibrium_along_load(*engine, stiffness, conditions, options);
    EXPECT_TRUE(found.displacement.allFinite());
    EXPECT_LE(found.estimated_error_mm, tolerance_mm);
    return found.displacement;
}

}  // namespace tissuewarp::stability
