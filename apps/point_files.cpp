#include "apps/point_files.hpp"

#include "apps/file_kind.hpp"
#include "core/atomic_file.hpp"
#include "imaging/vector_sampling.hpp"
#include "meshing/mesh_io.hpp"
#include "registration/evaluation.hpp"
#include "registration/io/extent.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

Eigen::Matrix3Xd read_points(const std::filesystem::path& path, Observer& observer) {
    if (file_kind(path) == FileKind::Surface) return read_tissue_surface(path, observer).nodes;
    return registration::read_points(path, observer);
}

meshing::SurfaceMesh read_tissue_surface(const std::filesystem::path& path, Observer& observer) {
    meshing::SurfaceMesh surface = meshing::read_surface(path, observer).mesh;
    registration::detail::require_millimetres(surface.nodes, "'" + path.string() + "': the surface is");
    return surface;
}

void write_columns(const std::vector<Column>& columns, const std::filesystem::path& path) {
    std::string text;
    for (const Column& column : columns) text += (text.empty() ? "" : ",") + column.name;
    text += '\n';
    for (Eigen::Index row = 0; row < columns.front().values.size(); ++row)
        for (std::size_t c = 0; c < columns.size(); ++c)
            text += fmt::format("{:.6f}{}", columns[c].values[row], c + 1 < columns.size() ? ',' : '\n');
    write_file(text, path);
}

void append_points(std::vector<Column>& columns, const std::string& prefix, const Eigen::Matrix3Xd& points) {
    for (int axis = 0; axis < 3; ++axis)
        columns.push_back({prefix + std::string(1, "xyz"[axis]), points.row(axis).transpose()});
}

Eigen::Matrix3Xd displaced(const Eigen::Matrix3Xd& points, const imaging::Volume& given) {
    if (given.channels() != 3)
        throw InvalidInput(
            fmt::format("the displacement field has {} components; give one with three", given.channels()));
    const imaging::VectorSampler field(given.as(CV_32F));
    Eigen::Matrix3Xd result = points;
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
        const Eigen::Vector3d point = points.col(p);
        if (!field.contains(point))
            throw InvalidInput(
                fmt::format("point {} ({:.2f}, {:.2f}, {:.2f}) lies outside the displacement field; give "
                            "a field whose grid holds it",
                            p + 1, point[0], point[1], point[2]));
        result.col(p) += field.value(point);
    }
    return result;
}

}  // namespace tissuewarp::apps
