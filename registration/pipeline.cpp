// During the operation, in the order of the method:
//   align rigidly → { match interfaces to the image → springs → equilibrium }, rematched on the deformed mesh.

#include "registration/pipeline.hpp"

#include "imaging/labels.hpp"
#include "registration/detail/stopwatch.hpp"
#include "registration/detail/surface_springs.hpp"
#include "shaders/device.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration {

namespace {

using detail::Match;

/// Elements below which one step on the CPU costs less than the GPU's dispatches.
constexpr int least_elements_for_gpu = 20000;

bool has_gpu() {
    const auto devices = shaders::list_devices();
    return std::any_of(devices.begin(), devices.end(),
                       [](const shaders::DeviceInfo& device) { return device.hardware && device.problem.empty(); });
}

std::unique_ptr<tled::Engine> make_engine(const PreparedModel& prepared, const UpdateOptions& options) {
    if (options.device == Device::Gpu) return tled::make_gpu_engine(prepared.rest, options.gpu_index);
    const bool gpu = options.device == Device::Auto && prepared.rest.element_count() >= least_elements_for_gpu &&
                     has_gpu();
    if (gpu) return tled::make_gpu_engine(prepared.rest, options.gpu_index);
    return tled::make_cpu_engine(prepared.rest, tled::Scalar::Float32);
}

/// Search range of a round: geometric from the first to the last.
double range_of(const UpdateOptions& options, int round) {
    if (options.rematches < 2) return options.first_range_mm;
    const double t = std::min(1.0, double(round) / (options.rematches - 1));
    return options.first_range_mm * std::pow(options.last_range_mm / options.first_range_mm, t);
}

/// Matches every interface node of the deformed mesh to the fixed boundary along its normal. `scale_mm` is that of the
/// Geman–McClure weight (σ²/(σ² + d²))², which lowers what the model did not follow; infinite in the first round.
/// `most_mm` bounds the distance that a round asks for, so that elements are not turned over.
std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed,
                                    const Eigen::Isometry3d& placement, const Eigen::Matrix3Xd& displacement,
                                    const Eigen::Matrix3Xd& normals, double range_mm, double max_angle_deg,
                                    double scale_mm, double most_mm) {
    const auto& nodes = prepared.interfaces.nodes();
    std::vector<Match> matches(nodes.size());
    tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t i) {
        const InterfaceNode& node = nodes[i];
        if (std::isnan(node.offset)) return;
        const Eigen::Vector3d normal = placement.linear() * normals.col(static_cast<Eigen::Index>(i));
        const Eigen::Vector3d point =
            placement * Eigen::Vector3d(prepared.model.mesh.nodes.col(node.node) + displacement.col(node.node));
        const double distance = fixed.crossing(point, normal, node.inner, node.outer, range_mm, max_angle_deg);
        if (std::isnan(distance)) return;
        matches[i].found = true;
        matches[i].distance_mm = std::clamp(distance - node.offset, -most_mm, most_mm);
        const double squared = scale_mm * scale_mm;
        matches[i].weight =
            std::isinf(scale_mm) ? 1.0 : std::pow(squared / (squared + std::pow(matches[i].distance_mm, 2)), 2);
    });
    return matches;
}

double mean_residual(const std::vector<Match>& matches) {
    double sum = 0, weights = 0;
    for (const Match& match : matches) {
        sum += match.weight * std::abs(match.distance_mm);
        weights += match.weight;
    }
    return weights > 0 ? sum / weights : 0;
}

void require_common_labels(const PreparedModel& prepared, const imaging::Volume& fixed_labels) {
    for (const int label : imaging::labels_in(fixed_labels.as(CV_32S)))
        if (prepared.model.materials.contains(label)) return;
    throw InvalidInput("the fixed label map holds none of the labels of the model; check the label tables");
}

std::vector<std::string> doubts(const PreparedModel& prepared, const UpdateResult& result) {
    std::vector<std::string> reasons;
    const Round& last = result.rounds.back();
    const double spacing = prepared.labels.geometry.spacing.maxCoeff();
    if (2 * last.matched < last.interface_nodes)
        reasons.push_back("only " + std::to_string(last.matched) + " of " + std::to_string(last.interface_nodes) +
                          " boundary nodes found their boundary in the fixed labels");
    if (last.mean_residual_mm > spacing)
        reasons.push_back("the surfaces still differ by " + std::to_string(last.mean_residual_mm) +
                          " mm on average, more than a voxel");
    if (result.min_jacobian < 0.1)
        reasons.push_back("tissue is compressed to " + std::to_string(result.min_jacobian) +
                          " of its volume in one element");
    return reasons;
}

}  // namespace

UpdateResult update(const PreparedModel& prepared, const imaging::Volume& fixed_labels, const UpdateOptions& options,
                    Observer& observer) {
    require_common_labels(prepared, fixed_labels);
    detail::Stopwatch stopwatch;
    UpdateResult result;
    if (options.align) result.alignment = align_labels(prepared.labels, fixed_labels, options.alignment, observer);
    const Eigen::Isometry3d& placement = result.alignment.placement;
    result.times.push_back(stopwatch.lap("rigid alignment"));

    std::vector<int> labels;
    for (const auto& [label, material] : prepared.model.materials) labels.push_back(label);
    const LabelBoundaryField fixed(fixed_labels, labels);
    const std::unique_ptr<tled::Engine> engine = make_engine(prepared, options);
    result.engine = engine->description();
    result.times.push_back(stopwatch.lap("boundary maps"));

    double matching_seconds = 0, solving_seconds = 0;
    const auto& interfaces = prepared.interfaces;
    Eigen::Matrix3Xd u = Eigen::Matrix3Xd::Zero(3, prepared.rest.node_count);
    for (int round = 0; round < options.rematches; ++round) {
        Round record;
        record.range_mm = range_of(options, round);
        const Eigen::Matrix3Xd normals = interfaces.normals(prepared.model.mesh.nodes + u);
        const double scale = round == 0 ? INFINITY : std::max(options.residual_scale_mm, record.range_mm / 3);
        const std::vector<Match> matches =
            match_interfaces(prepared, fixed, placement, u, normals, record.range_mm, options.max_angle_deg, scale, options.most_step_mm);
        const auto conditions = tled::nodal_conditions(
            detail::matched_springs(interfaces, matches, normals, u, prepared.options), prepared.rest.node_count);
        record.interface_nodes = static_cast<int>(matches.size());
        record.matched =
            static_cast<int>(std::count_if(matches.begin(), matches.end(), [](auto& m) { return m.found; }));
        if (record.matched == 0)
            throw InvalidInput("no boundary of the model was found in the fixed labels within " +
                               std::to_string(record.range_mm) + " mm; check that the images show the same organ");
        record.mean_residual_mm = mean_residual(matches);
        matching_seconds += stopwatch.lap("").seconds;

        const tled::EquilibriumResult solved =
            tled::equilibrium(*engine, prepared.stiffness, conditions, options.equilibrium, &u, observer);
        record.largest_change_mm = std::sqrt((solved.displacement - u).colwise().squaredNorm().maxCoeff());
        record.force_evaluations = solved.force_evaluations;
        record.estimated_error_mm = solved.estimated_error_mm;
        u = solved.displacement;
        result.min_jacobian = solved.min_jacobian;
        result.rounds.push_back(record);
        solving_seconds += stopwatch.lap("").seconds;
        observer.checkpoint("registration", double(round + 1) / options.rematches);
    }
    result.times.push_back({"correspondence", matching_seconds});
    result.times.push_back({"equilibrium", solving_seconds});
    result.deformation = {prepared.model.mesh, u, placement};
    result.doubts = doubts(prepared, result);
    return result;
}

}  // namespace tissuewarp::registration
