// During the operation, in the order of the method:
//   align rigidly → { match interfaces to the image → springs → equilibrium }, rematched on the deformed mesh.

#include "registration/pipeline.hpp"

#include "imaging/labels.hpp"
#include "registration/detail/doubts.hpp"
#include "registration/detail/engine_choice.hpp"
#include "registration/detail/matching.hpp"
#include "registration/detail/stopwatch.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration {

namespace {

using detail::Match;

/// Search range of a round: geometric from the first to the last.
double range_of(const UpdateOptions& options, int round) {
    if (options.rematches < 2) return options.last_range_mm;
    const double t = std::min(1.0, double(round) / (options.rematches - 1));
    return options.first_range_mm * std::pow(options.last_range_mm / options.first_range_mm, t);
}

void require_common_labels(const PreparedModel& prepared, const imaging::Volume& fixed_labels) {
    for (const int label : imaging::labels_in(fixed_labels.as(CV_32S)))
        if (prepared.model.materials.contains(label)) return;
    throw InvalidInput("the fixed label map holds none of the labels of the model; check the label tables");
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
          engine_(detail::make_engine(prepared, options, observer)),
          equilibrium_(options.equilibrium),
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
    tled::EquilibriumOptions equilibrium_;
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
                equilibrium_.method = options_.equilibrium.method;
                step_mm_ /= 2;
                observer_.note("a round is repeated with steps of at most " + detail::to_text(step_mm_) +
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
            detail::match_interfaces(prepared_, fixed_, result_.alignment.placement, displacement_, normals,
                                     {record.range_mm, options_.max_angle_deg, scale, step_mm_});
        if (round == options_.rematches - 1) detail::trim(matches, options_.trimmed_share, options_.residual_scale_mm);
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
                               detail::to_text(record.range_mm) + " mm; check that the images show the same organ");
        record.mean_residual_mm = detail::mean_residual(matches);
        matching_seconds_ += stopwatch.lap("").seconds;

        const tled::EquilibriumResult solved =
            tled::equilibrium(*engine_, prepared_.stiffness, conditions, equilibrium_, &displacement_, observer_);
        equilibrium_.method = solved.method;  // chosen and explained once, not in every round
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
    result.doubts = detail::doubts(prepared, fixed_labels, result);
    return result;
}

}  // namespace tissuewarp::registration
