#include "registration/io/displacements.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <array>
#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

namespace tissuewarp::registration {

namespace {

/// Places of a grid across the field, and what it holds there.
struct Samples {
    Eigen::Matrix3Xd indices, points, values;  // voxels; mm, LPS; as in the file
};

Samples samples_of(const imaging::Volume& field) {
    constexpr int per_axis = 24;
    const auto& size = field.geometry.size;
    const auto* components = field.data<float>();
    std::vector<Eigen::Vector3d> indices, points, values;
    std::array<int, 3> step{};
    for (std::size_t axis = 0; axis < 3; ++axis) step[axis] = std::max(1, size[axis] / per_axis);
    for (int z = 0; z < size[2]; z += step[2])
        for (int y = 0; y < size[1]; y += step[1])
            for (int x = 0; x < size[0]; x += step[0]) {
                const auto voxel = (static_cast<std::ptrdiff_t>(z) * size[1] + y) * size[0] + x;
                indices.emplace_back(x, y, z);
                points.push_back(field.geometry.point(indices.back()));
                values.emplace_back(components[3 * voxel], components[3 * voxel + 1], components[3 * voxel + 2]);
            }
    const auto columns = [](const std::vector<Eigen::Vector3d>& of) -> Eigen::Matrix3Xd {
        return Eigen::Map<const Eigen::Matrix3Xd>(of.front().data(), 3, static_cast<Eigen::Index>(of.size()));
    };
    return {columns(indices), columns(points), columns(values)};
}

/// How much each component grows along the coordinate of its own number (least squares).
Eigen::Vector3d growth(const Eigen::Matrix3Xd& values, const Eigen::Matrix3Xd& coordinates) {
    const Eigen::Matrix3Xd at = coordinates.colwise() - coordinates.rowwise().mean(),
                           of = values.colwise() - values.rowwise().mean();
    return at.cwiseProduct(of).rowwise().sum().cwiseQuotient(at.cwiseAbs2().rowwise().sum());
}

std::string text_of(const Eigen::Vector3d& slopes) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(2) << slopes[0] << ", " << slopes[1] << " and " << slopes[2];
    return text.str();
}

constexpr double most_off = 0.3;  // of a growth from 1

/// Positions count from the first voxel. A true stretch by 1 mm per voxel (0.3 of tissue in voxels of 3.3 mm) does not:
/// about the middle of the grid it lies half of the extent from the index everywhere.
void require_no_voxels(const Samples& samples, const std::filesystem::path& path) {
    constexpr double nearest = 0.25;  // of the extent, in the mean
    const Eigen::Vector3d slopes = growth(samples.values, samples.indices),
                          off = (samples.values - samples.indices).cwiseAbs().rowwise().mean(),
                          extent = samples.indices.rowwise().maxCoeff();
    if (!((slopes.array() - 1).abs() < most_off).all()) return;
    if (!(off.array() < nearest * extent.array()).all()) return;
    throw InvalidInput(
        "'" + path.string() +
        "' holds positions (in voxels), not displacements in mm: along its axes its components grow by " +
        text_of(slopes) +
        " per voxel from about 0 at the first; take each position to LPS mm by the header of the image that it counts "
        "in, subtract the voxel's own position, and write displacements in LPS mm");
}

/// Along LPS mm positions grow by 1; displacements do little, for which 1 is tissue twice as long and -1 tissue without
/// length. All of either are none of tissue, but three times -1 may be a turn.
void require_no_millimetres(const Samples& samples, const std::filesystem::path& path) {
    const Eigen::Vector3d slopes = growth(samples.values, samples.points);
    if (!((slopes.array().abs() - 1).abs() < most_off).all()) return;
    if (slopes.maxCoeff() < 0) return;
    const auto frame = [&]() -> std::string {
        if (slopes[2] < 0 || slopes[0] * slopes[1] < 0) return "of axes of their own";
        return slopes[0] > 0 ? "LPS" : "RAS";
    };
    throw InvalidInput("'" + path.string() + "' holds positions (" + frame() +
                       "), not displacements: its components grow by " + text_of(slopes) +
                       " mm per mm; subtract from each voxel its own position, and write displacements in LPS mm");
}

}  // namespace

void require_displacements(const imaging::Volume& field, const std::filesystem::path& path) {
    const Samples samples = samples_of(field);
    require_no_voxels(samples, path);
    require_no_millimetres(samples, path);
}

}  // namespace tissuewarp::registration
