#include "tests/verification/reference_file.hpp"

#include "core/errors.hpp"
#include "tests/support/folders.hpp"
#include "tests/verification/solution.hpp"

#include <fstream>
#include <limits>

namespace tissuewarp::verification {

using Eigen::Vector3d;
using Eigen::VectorXd;
using nlohmann::json;

namespace {

void flatten(const json& value, std::vector<double>& out) {
    if (value.is_array()) {
        for (const json& entry : value) flatten(entry, out);
    } else {
        out.push_back(value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>());
    }
}

}  // namespace

json reference_file(const std::string& name) {
    const std::string path = (tissuewarp::test::source_folder() / "data/reference/").string() + name + ".json";
    std::ifstream stream(path);
    if (!stream) throw IoError("cannot read " + path + ": run from a complete checkout");
    return json::parse(stream);
}

tled::Material material_of(const json& file, Law law) {
    const json& moduli = file.at("material");
    const double mu = kPa_per_Pa * moduli.at("mu_Pa").get<double>();
    const double lambda = kPa_per_Pa * moduli.at("lambda_Pa").get<double>();
    if (law == Law::Iso) return tled::NeoHookeanIso{mu, lambda + 2.0 / 3.0 * mu};
    return tled::NeoHookeanLnJ{mu, lambda};
}

tled::Material material_of(double youngs_modulus_kpa, double poisson_ratio, Law law) {
    if (law == Law::Iso) return tled::neo_hookean_iso(youngs_modulus_kpa, poisson_ratio);
    return tled::neo_hookean_lnj(youngs_modulus_kpa, poisson_ratio);
}

VectorXd numbers(const json& value, double scale) {
    std::vector<double> list;
    flatten(value, list);
    return scale * Eigen::Map<const VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
}

Eigen::Matrix3Xd positions_mm(const json& rows) {
    return numbers(rows, mm_per_m).reshaped(3, static_cast<Eigen::Index>(rows.size()));
}

Quantity quantity(const std::string& name, const std::string& unit, const json& entry, double scale,
                  std::function<VectorXd(const Solution&)> measure) {
    return {name, unit, numbers(entry.at("value"), scale), numbers(entry.at("uncertainty"), scale), std::move(measure)};
}

Quantity component_quantity(const std::string& name, const std::string& unit, const json& entry, int component,
                            double scale, std::function<double(const Solution&)> measure) {
    return {name, unit, numbers(entry.at("value"), scale).segment(component, 1),
            numbers(entry.at("uncertainty"), scale).segment(component, 1),
            [measure = std::move(measure)](const Solution& s) { return VectorXd::Constant(1, measure(s)); }};
}

const json& values_of(const json& file, Law law) {
    return file.at("values").at(law == Law::Iso ? "iso" : "lnJ");
}

Quantity energy_quantity(const json& values, double parts) {
    return component_quantity("energy", "mN mm", values.at("energy"), 0, mNmm_per_J,
                              [parts](const Solution& s) { return parts * s.energy; });
}

Quantity point_quantity(const json& points, const json& entry, const std::function<bool(const Vector3d&)>& keep,
                        std::function<Vector3d(const Solution&, const Vector3d&)> at) {
    const Eigen::Matrix3Xd all = positions_mm(points);
    const VectorXd value = numbers(entry.at("value"), mm_per_m),
                   uncertainty = numbers(entry.at("uncertainty"), mm_per_m);
    std::vector<Vector3d> kept;
    Quantity result{"points", "mm", {}, {}, {}};
    result.reference.resize(all.size());
    result.uncertainty.resize(all.size());
    for (Eigen::Index i = 0; i < all.cols(); ++i) {
        if (!keep(all.col(i))) continue;
        const auto place = 3 * static_cast<Eigen::Index>(kept.size());
        result.reference.segment<3>(place) = value.segment<3>(3 * i);
        result.uncertainty.segment<3>(place) = uncertainty.segment<3>(3 * i);
        kept.push_back(all.col(i));
    }
    const auto size = 3 * static_cast<Eigen::Index>(kept.size());
    result.reference.conservativeResize(size);
    result.uncertainty.conservativeResize(size);
    result.measure = [kept = std::move(kept), at = std::move(at)](const Solution& s) {
        VectorXd u(3 * static_cast<Eigen::Index>(kept.size()));
        for (std::size_t i = 0; i < kept.size(); ++i) u.segment<3>(3 * static_cast<Eigen::Index>(i)) = at(s, kept[i]);
        return u;
    };
    return result;
}

}  // namespace tissuewarp::verification
