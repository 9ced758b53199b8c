#include "apps/initial_transform.hpp"

#include "imaging/labels.hpp"
#include "registration/io/curves.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

using Eigen::Vector3d;

/// Below it a transform is rigid as it was written.
constexpr double least_deformation_mm = 0.1;
/// The inverse is suspected where it brings the middles so much nearer.
constexpr double suspicious_gain_mm = 10;

Vector3d middle_of(const imaging::Volume& labels) {
    return imaging::label_statistics(imaging::mask_of_all(labels)).at(1).centroid;
}

Vector3d middle_of(const imaging::Geometry& grid) {
    return grid.point(0.5 * Vector3d(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1));
}

/// A place of the organ, and where it was seen, roughly.
std::pair<Vector3d, Vector3d> middles(const RegistrationInputs& inputs) {
    const Vector3d organ = middle_of(inputs.moving_labels);
    if (inputs.point_pairs)
        return {inputs.point_pairs->moving.rowwise().mean(), inputs.point_pairs->fixed.rowwise().mean()};
    if (!inputs.fixed_labels.empty()) return {organ, middle_of(inputs.fixed_labels)};
    if (inputs.curves)
        return {registration::points_of(inputs.curves->moving).rowwise().mean(), inputs.curves->fixed.rowwise().mean()};
    if (inputs.fixed_surface) return {organ, inputs.fixed_surface->points.rowwise().mean()};
    return {organ, middle_of(inputs.fixed.geometry)};
}

std::string nearness_text(const RegistrationInputs& inputs, const Eigen::Isometry3d& start) {
    const auto [organ, seen] = middles(inputs);
    const double before = (organ - seen).norm(), after = (start * organ - seen).norm(),
                 inverse = (start.inverse() * organ - seen).norm();
    std::string text = fmt::format(
        "starts the organ's middle {:.1f} mm from that of what was seen; the headers, {:.1f} mm", after, before);
    if (inverse + suspicious_gain_mm < after)
        text += fmt::format(
            ". Its inverse would bring it to {:.1f} mm: it may map the wrong way, which is right from fixed "
            "points to moving ones, as ITK's transforms map",
            inverse);
    return text;
}

}  // namespace

void take_initial_transform(RegistrationInputs& inputs, const IntraoperativeOptions& options) {
    if (options.initial_transform.empty()) return;
    const std::string path = options.initial_transform.string();
    const registration::PointMap map = registration::read_point_map(options.initial_transform);
    if (map.type == imaging::FieldType::Modeling)
        throw InvalidInput(
            fmt::format("'{0}' says that its field maps moving points to fixed ones ('displacement field "
                        "type:=modeling'); turn it: "
                        "tissuewarp convert '{0}' transform.h5 --reference FIXED_IMAGE",
                        path));
    for (const std::string& note : map.notes) inputs.notes.push_back(fmt::format("'{}': {}", path, note));
    try {
        inputs.start = registration::start_pose(map, inputs.moving_labels);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(fmt::format("'{}': {}", path, problem.what()));
    }
    inputs.notes.push_back(fmt::format("'{}' {}", path, nearness_text(inputs, inputs.start->placement)));
    if (inputs.start->deformation_mm > least_deformation_mm)
        inputs.notes.push_back(
            fmt::format("'{}' is not rigid: {:.2f} mm of it in the organ (root mean square, at most "
                        "{:.2f} mm) are left to the registration, which begins with its rigid part",
                        path, inputs.start->deformation_mm, inputs.start->furthest_mm));
}

}  // namespace tissuewarp::apps
