#pragma once
/// The JSON files of data/reference (SI units) in mm, kPa, mN, mN mm.

#include "tests/verification/problem.hpp"

#include <nlohmann/json.hpp>

#include <cmath>

namespace tissuewarp::verification {

/// Is a coordinate on a plane, but for rounding?
inline bool near(double x, double plane) {
    return std::abs(x - plane) < 1e-9 * (1.0 + std::abs(plane));
}

constexpr double mm_per_m = 1e3, mN_per_N = 1e3, kPa_per_Pa = 1e-3, mNmm_per_J = 1e6, mm3_per_m3 = 1e9;

/// Throws IoError where the file is missing.
nlohmann::json reference_file(const std::string& name);

/// `material` of a file that gives λ and μ.
tled::Material material_of(const nlohmann::json& file, Law law);

/// E (kPa) and ν in one of the two laws.
tled::Material material_of(double youngs_modulus_kpa, double poisson_ratio, Law law);

/// All numbers of a nested array in order; null becomes NaN.
Eigen::VectorXd numbers(const nlohmann::json& value, double scale);

/// 3 × n positions from rows of three.
Eigen::Matrix3Xd positions_mm(const nlohmann::json& rows);

/// `value` and `uncertainty` of an entry, times `scale`.
Quantity quantity(const std::string& name, const std::string& unit, const nlohmann::json& entry, double scale,
                  std::function<Eigen::VectorXd(const Solution&)> measure);

/// The same for entry number `component` of an array.
Quantity component_quantity(const std::string& name, const std::string& unit, const nlohmann::json& entry,
                            int component, double scale, std::function<double(const Solution&)> measure);

/// The block of a law in `values`.
const nlohmann::json& values_of(const nlohmann::json& file, Law law);

/// Energy of the whole body, `parts` times that of the solved part.
Quantity energy_quantity(const nlohmann::json& values, double parts);

/// Displacements at points: those for which `keep` holds, each with the displacement that `at` finds.
Quantity point_quantity(const nlohmann::json& points, const nlohmann::json& entry,
                        const std::function<bool(const Eigen::Vector3d&)>& keep,
                        std::function<Eigen::Vector3d(const Solution&, const Eigen::Vector3d&)> at);

}  // namespace tissuewarp::verification
