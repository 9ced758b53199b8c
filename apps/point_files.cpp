#include "apps/point_files.hpp"

#include "apps/text_file.hpp"
#include "meshing/mesh_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::apps {

Eigen::Matrix3Xd read_points(const std::filesystem::path& path) {
    return meshing::read_surface(path).mesh.nodes;
}

void write_columns(const std::vector<Column>& columns, const std::filesystem::path& path) {
    std::string text;
    for (const Column& column : columns) text += (text.empty() ? "" : ",") + column.name;
    text += '\n';
    for (Eigen::Index row = 0; row < columns.front().values.size(); ++row)
        for (std::size_t c = 0; c < columns.size(); ++c)
            text += fmt::format("{:.6f}{}", columns[c].values[row], c + 1 < columns.size() ? ',' : '\n');
    write_text(text, path);
}

void append_points(std::vector<Column>& columns, const std::string& prefix, const Eigen::Matrix3Xd& points) {
    for (int axis = 0; axis < 3; ++axis)
        columns.push_back({prefix + std::string(1, "xyz"[axis]), points.row(axis).transpose()});
}

Eigen::Matrix3Xd displaced(const Eigen::Matrix3Xd& points, const imaging::Volume& given) {
    if (given.channels() != 3)
        throw InvalidInput(
            fmt::format("the displacement field has {} components; give one with three", given.channels()));
    const imaging::Volume field = given.as(CV_32F);
    const auto& size = field.geometry.size;
    const auto* values = field.voxels.ptr<float>();
    Eigen::Matrix3Xd result = points;
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
        const Eigen::Vector3d index = field.geometry.index(points.col(p));
        std::array<int, 3> lower{};
        Eigen::Vector3d fraction;
        for (int axis = 0; axis < 3; ++axis) {
            const int last = size[static_cast<std::size_t>(axis)] - 1;
            if (!(index[axis] >= -0.5 && index[axis] <= last + 0.5))
                throw InvalidInput(
                    fmt::format("point {} ({:.2f}, {:.2f}, {:.2f}) lies outside the displacement field; give "
                                "a field whose grid holds it",
                                p + 1, points(0, p), points(1, p), points(2, p)));
            const double clamped = std::clamp(index[axis], 0.0, double(last));
            lower[static_cast<std::size_t>(axis)] = std::min(int(clamped), std::max(0, last - 1));
            fraction[axis] = clamped - lower[static_cast<std::size_t>(axis)];
        }
        for (int corner = 0; corner < 8; ++corner) {
            double weight = 1;
            std::array<int, 3> at = lower;
            for (int axis = 0; axis < 3; ++axis) {
                const auto a = static_cast<std::size_t>(axis);
                const bool far = corner >> axis & 1;
                weight *= far ? fraction[axis] : 1 - fraction[axis];
                at[a] = std::min(at[a] + far, size[a] - 1);
            }
            const float* v = values + 3 * field.offset(at[0], at[1], at[2]);
            result.col(p) += weight * Eigen::Vector3d(v[0], v[1], v[2]);
        }
    }
    return result;
}

}  // namespace tissuewarp::apps
