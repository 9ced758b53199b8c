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
#include <cstdio>

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

std::unique_ptr<tled::Engine> make_engine(const PreparedModel& prepared, const UpdateOptions& options,
                                          Observer& observer) {
    if (options.device == Device::Gpu) return tled::make_gpu_engine(prepared.rest, options.gpu_index);
    const bool gpu =
        options.device == Device::Auto && prepared.rest.element_count() >= least_elements_for_gpu && has_gpu();
    if (gpu) try {
            return tled::make_gpu_engine(prepared.rest, options.gpu_index);
        } catch (const GpuUnavailable& reason) {
            observer.note(std::string("the CPU takes over from the GPU: ") + reason.what());
        }
    return tled::make_cpu_engine(prepared.rest, tled::Scalar::Float32);
}

/// Search range of a round: geometric from the first to the last.
double range_of(const UpdateOptions& options, int round) {
    if (options.rematches < 2) return options.last_range_mm;
    const double t = std::min(1.0, double(round) / (options.rematches - 1));
    return options.first_range_mm * std::pow(options.last_range_mm / options.first_range_mm, t);
}

/// What a round looks for, and how far it may pull.
struct Search {
    double range_mm = 0;
    double max_angle_deg = 0;
    double scale_mm = 0;  ///< of the Geman–McClure weight (σ²/(σ² + d²))², which lowers what the model did not follow
    double most_step_mm = 0;  ///< bound on the distance asked for, so that elements are not turned over
};

/// Matches every interface node of the deformed mesh to the fixed boundary along its normal.
std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed,
                                    const Eigen::Isometry3d& placement, const Eigen::Matrix3Xd& displacement,
                                    const Eigen::Matrix3Xd& normals, const Search& search) {
    const auto& nodes = prepared.interfaces.nodes();
    std::vector<Match> matches(nodes.size());
    tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t i) {
        const InterfaceNode& node = nodes[i];
        if (std::isnan(node.offset)) return;
        const Eigen::Vector3d normal = placement.linear() * normals.col(static_cast<Eigen::Index>(i));
        const Eigen::Vector3d point =
            placement * Eigen::Vector3d(prepared.model.mesh.nodes.col(node.node) + displacement.col(node.node));
        const double crossing =
            fixed.crossing(point, normal, node.inner, node.outer, search.range_mm, search.max_angle_deg);
        if (std::isnan(crossing)) return;
        const double distance = crossing - node.offset, squared = search.scale_mm * search.scale_mm;
        matches[i].found = true;
        matches[i].held_back = std::abs(distance) > search.most_step_mm;
        matches[i].distance_mm = std::clamp(distance, -search.most_step_mm, search.most_step_mm);
        matches[i].weight = std::pow(squared / (squared + distance * distance), 2);
    });
    return matches;
}

/// Drops the share of matches that the model follows least, where they are further off than `scale_mm` (Clatz 2005).
void trim(std::vector<Match>& matches, double share, double scale_mm) {
    std::vector<double> distances;
    for (const Match& match : matches)
        if (match.found) distances.push_back(std::abs(match.distance_mm));
    if (distances.empty()) return;
    const auto kept = static_cast<std::size_t>((1 - share) * double(distances.size() - 1));
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(kept), distances.end());
    const double limit = std::max(distances[kept], scale_mm);
    for (Match& match : matches)
        if (std::abs(match.distance_mm) > limit) match.weight = 0;
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

double labelled_volume(const imaging::Volume& labels) {
    return cv::countNonZero(imaging::mask_of_all(labels).voxels.reshape(1, 1)) * labels.geometry.voxel_volume();
}

std::string to_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f", value);
    return text;
}

std::vector<std::string> doubts(const PreparedModel& prepared, const imaging::Volume& fixed_labels,
                                const UpdateResult& result) {
    std::vector<std::string> reasons;
    const Round& last = result.rounds.back();
    const double spacing = prepared.labels.geometry.spacing.maxCoeff();
    if (2 * last.matched < last.interface_nodes)
        reasons.push_back("only " + std::to_string(last.matched) + " of " + std::to_string(last.interface_nodes) +
                          " boundary nodes found their boundary in the fixed labels");
    if (last.mean_residual_mm > spacing)
        reasons.push_back("the surfaces still differ by " + to_text(last.mean_residual_mm) +
                          " mm on average, more than a voxel");
    if (last.held_back > last.matched / 50)
        reasons.push_back(std::to_string(last.held_back) + " of " + std::to_string(last.matched) +
                          " boundary nodes are still far from where they belong; allow more rounds");
    if (result.min_jacobian < 0.1)
        reasons.push_back("tissue is compressed to " + to_text(result.min_jacobian) + " of its volume in one element");
    const double growth = labelled_volume(fixed_labels) / labelled_volume(prepared.labels);
    double poisson = 0;
    for (const auto& [label, material] : prepared.model.materials)
        poisson = std::max(poisson, tled::poisson_ratio(material));
    if (std::abs(growth - 1) > 0.1 && poisson > 0.4)
        reasons.push_back("the labelled volume changed by the factor " + to_text(growth) +
                          ", which tissue of Poisson's ratio " + to_text(poisson) +
                          " resists; for lungs and other tissue that changes volume take 0.3 or less");
    return reasons;
}

/// The rounds of matching and equilibrium.
class Rematching {
public:
    Rematching(const PreparedModel& prepared, const LabelBoundaryField& fixed, const UpdateOptions& options,
               UpdateResult& result, Observer& observer)
        : prepared_(prepared),
          fixed_(fixed),
          options_(options),
          result_(result),
          observer_(observer),
          engine_(make_engine(prepared, options, observer)),
          step_mm_(options.most_step_mm),
          displacement_(Eigen::Matrix3Xd::Zero(3, prepared.rest.node_count)) {
        result_.engine = engine_->description();
    }

    /// Leaves the elastic displacement in the moving frame, 3 × N mm.
    Eigen::Matrix3Xd run() {
        int round = 0;
        for (int done = 0; done < 2 * options_.rematches && round < options_.rematches; ++done) {
            const Round record = attempt(round);
            result_.rounds.push_back(record);
            observer_.checkpoint("registration", double(round + 1) / options_.rematches);
            if (50 * record.held_back > record.matched) continue;  // more than 2 %: the same range once more
            const bool settled = record.largest_change_mm < options_.settled_mm;
            round = settled && round < options_.rematches - 2 ? options_.rematches - 1 : round + 1;
        }
        result_.times.push_back({"correspondence", matching_seconds_});
        result_.times.push_back({"equilibrium", solving_seconds_});
        return displacement_;
    }

private:
    const PreparedModel& prepared_;
    const LabelBoundaryField& fixed_;
    const UpdateOptions& options_;
    UpdateResult& result_;
    Observer& observer_;
    std::unique_ptr<tled::Engine> engine_;
    double step_mm_;
    Eigen::Matrix3Xd displacement_;
    double matching_seconds_ = 0, solving_seconds_ = 0;

    /// One round; where the equilibrium fails, again with half the step bound.
    Round attempt(int round) {
        constexpr int most_halvings = 4;
        for (int halving = 0;; ++halving) {
            try {
                return match_and_solve(round);
            } catch (const SolverFailure& failure) {
                if (halving == most_halvings) throw;
                step_mm_ /= 2;
                observer_.note("a round is repeated with steps of at most " + to_text(step_mm_) +
                               " mm: " + failure.what());
            }
        }
    }

    Round match_and_solve(int round) {
        detail::Stopwatch stopwatch;
        Round record;
        record.range_mm = range_of(options_, round);
        const auto& interfaces = prepared_.interfaces;
        const Eigen::Matrix3Xd normals = interfaces.normals(prepared_.model.mesh.nodes + displacement_);
        const double scale = round == 0 ? 1e6 : std::max(options_.residual_scale_mm, record.range_mm / 3);
        std::vector<Match> matches =
            match_interfaces(prepared_, fixed_, result_.alignment.placement, displacement_, normals,
                             {record.range_mm, options_.max_angle_deg, scale, step_mm_});
        if (round > 0) trim(matches, options_.trimmed_share, options_.residual_scale_mm);
        const auto conditions = tled::nodal_conditions(
            detail::matched_springs(interfaces, matches, normals, displacement_, prepared_.options),
            prepared_.rest.node_count);
        record.interface_nodes = static_cast<int>(matches.size());
        for (const Match& match : matches) {
            record.matched += match.found;
            record.held_back += match.held_back;
        }
        if (record.matched == 0)
            throw InvalidInput("no boundary of the model was found in the fixed labels within " +
                               to_text(record.range_mm) + " mm; check that the images show the same organ");
        record.mean_residual_mm = mean_residual(matches);
        matching_seconds_ += stopwatch.lap("").seconds;

        const tled::EquilibriumResult solved = tled::equilibrium(*engine_, prepared_.stiffness, conditions,
                                                                 options_.equilibrium, &displacement_, observer_);
        record.largest_change_mm = std::sqrt((solved.displacement - displacement_).colwise().squaredNorm().maxCoeff());
        record.force_evaluations = solved.force_evaluations;
        record.estimated_error_mm = solved.estimated_error_mm;
        displacement_ = solved.displacement;
        result_.min_jacobian = solved.min_jacobian;
        solving_seconds_ += stopwatch.lap("").seconds;
        return record;
    }
};

}  // namespace

UpdateResult update(const PreparedModel& prepared, const imaging::Volume& fixed_labels, const UpdateOptions& options,
                    Observer& observer) {
    require_common_labels(prepared, fixed_labels);
    detail::Stopwatch stopwatch;
    UpdateResult result;
    if (options.align) result.alignment = align_labels(prepared.labels, fixed_labels, options.alignment, observer);
    result.times.push_back(stopwatch.lap("rigid alignment"));

    std::vector<int> labels;
    for (const auto& [label, material] : prepared.model.materials) labels.push_back(label);
    const LabelBoundaryField fixed(fixed_labels, labels);
    result.times.push_back(stopwatch.lap("boundary maps"));

    const Eigen::Matrix3Xd displacement = Rematching(prepared, fixed, options, result, observer).run();
    result.deformation = {prepared.model.mesh, displacement, result.alignment.placement};
    result.doubts = doubts(prepared, fixed_labels, result);
    return result;
}

}  // namespace tissuewarp::registration
