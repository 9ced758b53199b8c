#include "tests/verification/cube_reference.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tled/reference.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>

namespace tissuewarp::verification {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr double edge_mm = 100.0, mm_per_m = 1e3, kPa_per_Pa = 1e-3, mN_per_N = 1e3, mNmm_per_J = 1e6;

Matrix3Xd points_mm(const nlohmann::json& rows) {
    Matrix3Xd result(3, static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
            result(static_cast<int>(c), static_cast<int>(i)) = mm_per_m * rows[i][c].get<double>();
        }
    }
    return result;
}

// A number is F_z, a pair is F_x, F_z.
Vector3d force_mN(const nlohmann::json& value) {
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    if (value.is_number()) return {unknown, unknown, mN_per_N * value.get<double>()};
    return {mN_per_N * value[0].get<double>(), unknown, mN_per_N * value[1].get<double>()};
}

// Stands in the statement's text alone.
Vector3d top_displacement_mm(const std::string& name) {
    if (name == "p1_cube_stretch") return {0, 0, 20};
    if (name == "p2_cube_shear") return {50, 0, 0};
    if (name == "p2_cube_compress_mild") return {0, 0, -15};
    throw InvalidInput("unknown cube problem " + name);
}

// Value of a linear nodal field at a point of the box, by the Kuhn cell that holds it: the path from the cell's lowest
// corner along the axes in falling order of the local coordinate.
Vector3d interpolate(const Matrix3Xd& nodal, int cells, const Vector3d& point) {
    Eigen::Vector3i cell;
    Vector3d local;
    for (int c = 0; c < 3; ++c) {
        const double x = point[c] * cells / edge_mm;
        cell[c] = std::min(static_cast<int>(std::floor(x)), cells - 1);
        local[c] = x - cell[c];
    }
    std::array<int, 3> axis{0, 1, 2};
    std::sort(axis.begin(), axis.end(), [&](int a, int b) { return local[a] > local[b]; });
    const auto value = [&]() { return nodal.col(cell[0] + (cells + 1) * (cell[1] + (cells + 1) * cell[2])); };
    Vector3d result = (1.0 - local[axis[0]]) * value();
    for (int k = 0; k < 3; ++k) {
        ++cell[axis[static_cast<std::size_t>(k)]];
        const double next = k < 2 ? local[axis[static_cast<std::size_t>(k) + 1]] : 0.0;
        result += (local[axis[static_cast<std::size_t>(k)]] - next) * value();
    }
    return result;
}

}  // namespace

CubeReference cube_reference(const std::string& file, Law law) {
    std::ifstream stream(file);
    if (!stream) throw IoError("cannot read " + file + ": run from a complete checkout");
    const nlohmann::json json = nlohmann::json::parse(stream);
    const nlohmann::json& values = json.at("values").at(law == Law::Iso ? "iso" : "lnJ");
    const nlohmann::json& moduli = json.at("material");
    const double mu = kPa_per_Pa * moduli.at("mu_Pa").get<double>();
    const double lambda = kPa_per_Pa * moduli.at("lambda_Pa").get<double>();

    CubeReference result;
    result.name = json.at("problem").get<std::string>();
    result.top_displacement = top_displacement_mm(result.name);
    if (law == Law::Iso) {
        result.material = tled::NeoHookeanIso{mu, lambda + 2.0 / 3.0 * mu};
    } else {
        result.material = tled::NeoHookeanLnJ{mu, lambda};
    }
    result.force = force_mN(values.at("force").at("value"));
    result.force_uncertainty = force_mN(values.at("force").at("uncertainty"));
    result.points = points_mm(json.at("points"));
    result.displacement = points_mm(values.at("u").at("value"));
    result.displacement_uncertainty = points_mm(values.at("u").at("uncertainty"));
    result.energy = mNmm_per_J * values.at("energy").at("value").get<double>();
    result.energy_uncertainty = mNmm_per_J * values.at("energy").at("uncertainty").get<double>();
    return result;
}

CubeSolution solve_cube(const CubeReference& reference, tled::Element element, int cells) {
    tled::Model model;
    model.mesh = meshing::box_mesh(Vector3d::Constant(edge_mm), {cells, cells, cells});
    model.materials[1] = reference.material;
    model.element = element;
    const int layer = (cells + 1) * (cells + 1), top = model.mesh.node_count() - layer;
    tled::Conditions conditions;
    for (int i = 0; i < layer; ++i) {
        conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
        conditions.prescribed.push_back({top + i, {true, true, true}, reference.top_displacement});
    }
    const tled::RestState rest = tled::rest_state(model);
    const tled::NewtonResult found =
        tled::newton_equilibrium(rest, tled::nodal_conditions(conditions, rest.node_count), {.tolerance_mm = 1e-4});

    CubeSolution result;
    result.cells = cells;
    result.iterations = found.iterations;
    result.force = tled::internal_force(rest, found.displacement).rightCols(layer).rowwise().sum();
    result.displacement.resize(3, reference.points.cols());
    for (int i = 0; i < reference.points.cols(); ++i) {
        result.displacement.col(i) = interpolate(found.displacement, cells, reference.points.col(i));
    }
    result.energy = tled::elastic_energy(rest, found.displacement);
    result.min_jacobian = tled::jacobians(rest, found.displacement).minCoeff();
    return result;
}

Extrapolation richardson(double coarse, double middle, double fine, double ratio) {
    const double fall = (coarse - middle) / (middle - fine);
    if (!(fall > 1.0)) return {fine, std::numeric_limits<double>::quiet_NaN()};
    return {fine + (fine - middle) / (fall - 1.0), std::log(fall) / std::log(ratio)};
}

double largest_point_error(const CubeReference& reference, const CubeSolution& solution, double margin) {
    double largest = 0.0;
    for (int i = 0; i < reference.points.cols(); ++i) {
        if (reference.points(2, i) < margin || reference.points(2, i) > edge_mm - margin) continue;
        largest = std::max(largest, (solution.displacement.col(i) - reference.displacement.col(i)).norm());
    }
    return largest;
}

}  // namespace tissuewarp::verification
