#include "apps/register_maps.hpp"

#include "meshing/mesh_io.hpp"
#include "registration/io/slicer_markups.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <cmath>

namespace tissuewarp::apps {

namespace {

using registration::ErrorEstimate;
using registration::MarkupPoint;
using registration::Trust;

const char* trust_text(Trust trust) {
    switch (trust) {
        case Trust::Shown:
            return "shown by the data";
        case Trust::Carried:
            return "carried by mechanics";
        default:
            return "do not trust";
    }
}

std::string estimate_text(const std::optional<ErrorEstimate>& estimate) {
    if (!estimate) return "outside the tissue: its error is not estimated";
    return fmt::format("estimated error {:.2f} mm (1 sigma), 95 % within {:.2f} mm, {}", estimate->deviation_mm,
                       estimate->interval_mm, trust_text(estimate->trust));
}

/// `places` are where the points lay before, moving frame.
std::vector<MarkupPoint> markups(const RegistrationRun& run, const Eigen::Matrix3Xd& places,
                                 const Eigen::Matrix3Xd& carried) {
    std::vector<std::optional<ErrorEstimate>> estimates;
    if (run.products.uncertainty) estimates = run.products.uncertainty->at(places);
    std::vector<MarkupPoint> points;
    for (Eigen::Index p = 0; p < carried.cols(); ++p) {
        if (!carried.col(p).allFinite()) continue;  // its tissue is gone
        const std::string text = estimates.empty() ? "" : estimate_text(estimates[static_cast<std::size_t>(p)]);
        points.push_back({std::to_string(p + 1), text, carried.col(p)});
    }
    return points;
}

}  // namespace

imaging::Volume magnitude(const imaging::Volume& field) {
    imaging::Volume result(field.geometry, CV_32FC1);
    const auto* vectors = field.data<cv::Vec3f>();
    auto* values = result.data<float>();
    const std::int64_t slice = std::int64_t{field.geometry.size[0]} * field.geometry.size[1];
    tbb::parallel_for(0, field.geometry.size[2], [&](int k) {
        for (std::int64_t n = slice * k; n < slice * (k + 1); ++n)
            values[n] = std::hypot(vectors[n][0], vectors[n][1], vectors[n][2]);
    });
    return result;
}

void write_organ(const RegistrationRun& run, const std::filesystem::path& path) {
    const registration::Deformation& deformation = run.result.deformation;
    const meshing::BoundarySurface boundary = meshing::boundary_surface(deformation.deformed_mesh());
    std::vector<meshing::MeshArray> arrays;
    const auto array = [&](const char* name, const auto& value_at) {
        Eigen::RowVectorXd values(boundary.surface.node_count());
        for (Eigen::Index n = 0; n < values.size(); ++n)
            values[n] = value_at(boundary.node_of[static_cast<std::size_t>(n)]);
        arrays.push_back({name, values});
    };
    if (run.products.uncertainty) {
        const std::vector<ErrorEstimate> errors = run.products.uncertainty->at_nodes();
        const auto error = [&](int node) -> const ErrorEstimate& { return errors[static_cast<std::size_t>(node)]; };
        array("deviation_mm", [&](int node) { return error(node).deviation_mm; });
        array("interval_95_mm", [&](int node) { return error(node).interval_mm; });
        array("trust", [&](int node) { return static_cast<double>(error(node).trust); });
    }
    const Eigen::RowVectorXd moved = (deformation.deformed_nodes() - deformation.mesh.nodes).colwise().norm();
    array("displacement_mm", [&](int node) { return moved[node]; });
    meshing::write_vtp(boundary.surface, path, arrays);
}

void write_landmark_markups(const RegistrationRun& run, const std::filesystem::path& path) {
    const registration::Landmarks& landmarks = *run.inputs.landmarks;
    std::vector<MarkupPoint> points = markups(run, landmarks.moving, run.products.landmarks);
    for (MarkupPoint& point : points) {
        const double off = (point.position - landmarks.fixed.col(std::stoi(point.label) - 1)).norm();
        std::string& text = point.description;
        text = fmt::format("{:.2f} mm from its place{}{}", off, text.empty() ? "" : "; ", text);
    }
    registration::write_slicer_markups(points, path);
}

void write_point_markups(const RegistrationRun& run, const std::filesystem::path& path) {
    registration::write_slicer_markups(markups(run, *run.inputs.points, run.products.points), path);
}

}  // namespace tissuewarp::apps
