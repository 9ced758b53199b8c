#include "report/detail/viewer_surface.hpp"

#include "report/detail/encoding.hpp"
#include "report/detail/picture.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

namespace tissuewarp::report::detail {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Triangles = std::vector<std::array<int, 3>>;
using Bytes = std::vector<unsigned char>;

/// By node the cell of a grid that it lies in, counted from 0.
std::vector<int> cells(const Matrix3Xd& nodes, double edge, int& count) {
    std::map<std::array<int, 3>, int> number;
    std::vector<int> cell;
    const Vector3d lower = nodes.rowwise().minCoeff();
    for (const auto& node : nodes.colwise()) {
        const Eigen::Vector3i at = ((node - lower) / edge).array().floor().cast<int>();
        cell.push_back(number.try_emplace({at[0], at[1], at[2]}, static_cast<int>(number.size())).first->second);
    }
    count = static_cast<int>(number.size());
    return cell;
}

/// Of each cell the node nearest to the mean of its nodes.
std::vector<int> representatives(const Matrix3Xd& nodes, const std::vector<int>& cell, int count) {
    Matrix3Xd mean = Matrix3Xd::Zero(3, count);
    Eigen::VectorXd members = Eigen::VectorXd::Zero(count);
    for (std::size_t n = 0; n < cell.size(); ++n) {
        mean.col(cell[n]) += nodes.col(static_cast<Eigen::Index>(n));
        ++members[cell[n]];
    }
    std::vector<int> nearest(static_cast<std::size_t>(count), -1);
    for (std::size_t n = 0; n < cell.size(); ++n) {
        int& best = nearest[static_cast<std::size_t>(cell[n])];
        const Vector3d middle = mean.col(cell[n]) / members[cell[n]];
        const auto distance = [&](int node) { return (nodes.col(node) - middle).squaredNorm(); };
        if (best < 0 || distance(static_cast<int>(n)) < distance(best)) best = static_cast<int>(n);
    }
    return nearest;
}

/// Faces to the outside first, then those between labels.
Triangles shown_faces(const meshing::TetMesh& mesh, int& outer) {
    Triangles faces, inner;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh))
        (face.outer == 0 ? faces : inner).push_back(face.nodes);
    outer = static_cast<int>(faces.size());
    faces.insert(faces.end(), inner.begin(), inner.end());
    return faces;
}

/// The nodes that the faces use; these then count them.
std::vector<int> take_used(Triangles& faces) {
    std::vector<int> used;
    for (const auto& face : faces) used.insert(used.end(), face.begin(), face.end());
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (auto& face : faces)
        for (int& node : face) node = static_cast<int>(std::lower_bound(used.begin(), used.end(), node) - used.begin());
    return used;
}

void append(Bytes& bytes, std::uint16_t value) {
    bytes.push_back(static_cast<unsigned char>(value & 255));
    bytes.push_back(static_cast<unsigned char>(value >> 8));
}

void append_positions(Bytes& bytes, const Matrix3Xd& points, const Vector3d& lower, const Vector3d& extent) {
    for (const auto& point : points.colwise())
        for (int axis = 0; axis < 3; ++axis)
            append(bytes, static_cast<std::uint16_t>(std::lround(65535 * (point[axis] - lower[axis]) / extent[axis])));
}

/// The voxel of tissue that is nearest to a place on its surface, of two voxels at the most away; −1 where none is.
std::int64_t tissue_near(const imaging::Volume& trust, const Vector3d& place) {
    const Eigen::Vector3i middle = trust.geometry.index(place).array().round().cast<int>();
    std::int64_t best = -1;
    int nearest = 100;
    for (int k = -2; k <= 2; ++k)
        for (int j = -2; j <= 2; ++j)
            for (int i = -2; i <= 2; ++i) {
                const Eigen::Vector3i at = middle + Eigen::Vector3i(i, j, k);
                const int distance = i * i + j * j + k * k;
                bool within = distance < nearest;
                for (int axis = 0; axis < 3; ++axis)
                    within = within && at[axis] >= 0 && at[axis] < trust.geometry.size[static_cast<std::size_t>(axis)];
                if (!within || trust.data<std::uint8_t>()[trust.offset(at[0], at[1], at[2])] == 0) continue;
                nearest = distance;
                best = trust.offset(at[0], at[1], at[2]);
            }
    return best;
}

void append_errors(Bytes& bytes, const ReportInput& input, const Matrix3Xd& places, double error_mm) {
    const auto count = static_cast<std::size_t>(places.cols());
    Bytes errors(count, 0), trust(count, 0);
    if (input.uncertainty != nullptr) {
        const imaging::Volume deviation = input.uncertainty->as(CV_32F), levels = input.trust->as(CV_8U);
        for (std::size_t n = 0; n < count; ++n) {
            const std::int64_t at = tissue_near(levels, places.col(static_cast<Eigen::Index>(n)));
            if (at < 0) continue;
            errors[n] = cv::saturate_cast<std::uint8_t>(255 * deviation.data<float>()[at] / error_mm);
            trust[n] = levels.data<std::uint8_t>()[at];
        }
    }
    bytes.insert(bytes.end(), errors.begin(), errors.end());
    bytes.insert(bytes.end(), trust.begin(), trust.end());
}

nlohmann::json three(const Vector3d& v) {
    return {v[0], v[1], v[2]};
}

}  // namespace

Decimated decimated(const Matrix3Xd& nodes, const Triangles& triangles, int outer, int most) {
    const Vector3d extent = nodes.rowwise().maxCoeff() - nodes.rowwise().minCoeff();
    double edge = extent.maxCoeff() / 1e4;
    int count = 0;
    std::vector<int> cell = cells(nodes, edge, count);
    while (count > most) cell = cells(nodes, edge *= 1.3, count);
    Decimated result{representatives(nodes, cell, count), {}, 0};
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        std::array<int, 3> corner{};
        for (std::size_t c = 0; c < 3; ++c) corner[c] = cell[static_cast<std::size_t>(triangles[t][c])];
        if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) continue;
        result.triangles.push_back(corner);
        if (static_cast<int>(t) < outer) result.outer = static_cast<int>(result.triangles.size());
    }
    return result;
}

nlohmann::json viewer_surface(const ReportInput& input, double displacement_mm, double error_mm) {
    if (input.mesh == nullptr || input.fixed_nodes == nullptr) return nullptr;
    int outer = 0;
    Triangles faces = shown_faces(*input.mesh, outer);
    const std::vector<int> used = take_used(faces);
    const Eigen::Isometry3d alignment = alignment_of(input.report);
    const Matrix3Xd all_before = alignment * Matrix3Xd(input.mesh->nodes(Eigen::all, used));
    const Matrix3Xd all_after = (*input.fixed_nodes)(Eigen::all, used);
    const Decimated shown = decimated(all_after, faces, outer, most_viewer_nodes);
    const Matrix3Xd before = all_before(Eigen::all, shown.kept), after = all_after(Eigen::all, shown.kept);
    const Vector3d lower = before.rowwise().minCoeff().cwiseMin(after.rowwise().minCoeff());
    const Vector3d extent = before.rowwise().maxCoeff().cwiseMax(after.rowwise().maxCoeff()) - lower;
    Bytes bytes;
    append_positions(bytes, before, lower, extent);
    append_positions(bytes, after, lower, extent);
    for (const auto& triangle : shown.triangles)
        for (const int node : triangle) append(bytes, static_cast<std::uint16_t>(node));
    for (const double moved : (after - before).colwise().norm())
        bytes.push_back(cv::saturate_cast<std::uint8_t>(255 * moved / displacement_mm));
    append_errors(bytes, input, after, error_mm);
    return {{"nodes", before.cols()},  {"triangles", shown.triangles.size()},
            {"outer", shown.outer},    {"lower", three(lower)},
            {"extent", three(extent)}, {"data", "data:application/octet-stream;base64," + base64(bytes)}};
}

}  // namespace tissuewarp::report::detail
