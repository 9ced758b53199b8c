#include "apps/displacement_field.hpp"

#include "apps/inputs.hpp"
#include "apps/noted_images.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace tissuewarp::apps {
namespace fs = std::filesystem;
using imaging::Volume;

namespace {

/// How much each component grows per mm along its own coordinate (LPS): 1 for positions, little for displacements, for
/// which 1 is tissue twice as long.
Eigen::Vector3d growth(const Volume& field) {
    constexpr int per_axis = 24;  // places of a grid across the field
    const auto& size = field.geometry.size;
    std::vector<Eigen::Vector3d> at, of;
    const auto* components = field.data<float>();
    std::array<int, 3> step{};
    for (std::size_t axis = 0; axis < 3; ++axis) step[axis] = std::max(1, size[axis] / per_axis);
    for (int z = 0; z < size[2]; z += step[2])
        for (int y = 0; y < size[1]; y += step[1])
            for (int x = 0; x < size[0]; x += step[0]) {
                const auto voxel = (static_cast<std::ptrdiff_t>(z) * size[1] + y) * size[0] + x;
                at.push_back(field.geometry.point({double(x), double(y), double(z)}));
                of.emplace_back(components[3 * voxel], components[3 * voxel + 1], components[3 * voxel + 2]);
            }
    Eigen::Vector3d middle = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < at.size(); ++n) {
        middle += at[n] / double(at.size());
        mean += of[n] / double(at.size());
    }
    Eigen::Vector3d products = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < at.size(); ++n) {
        products += (at[n] - middle).cwiseProduct(of[n] - mean);
        squares += (at[n] - middle).cwiseAbs2();
    }
    return products.cwiseQuotient(squares);
}

void require_displacements(const Volume& field, const fs::path& path) {
    constexpr double most_off = 0.3;
    const Eigen::Vector3d slopes = growth(field);
    for (const auto& [frame, sign] : {std::pair{"LPS", 1.0}, {"RAS", -1.0}}) {
        const Eigen::Vector3d expected(sign, sign, 1);
        if (!((slopes - expected).cwiseAbs().maxCoeff() < most_off)) continue;
        throw InvalidInput(fmt::format(
            "'{}' holds positions ({}), not displacements: its components grow by {:.2f}, {:.2f} and {:.2f} mm per mm; "
            "subtract from each voxel its own position, and write displacements in LPS mm",
            path.string(), frame, slopes[0], slopes[1], slopes[2]));
    }
}

}  // namespace

Volume read_displacement(const fs::path& path, Observer& observer) {
    const Volume read = read_noted_volume(path, observer);
    if (read.channels() != 3)
        throw InvalidInput(
            fmt::format("'{}' has {} components; give a displacement field of three", path.string(), read.channels()));
    require_millimetres(read.geometry, path);
    Volume field = read.as(CV_32F);
    require_displacements(field, path);
    return field;
}

}  // namespace tissuewarp::apps
