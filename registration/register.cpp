// During the operation, in the order of the method:
//   align rigidly → { match interfaces to the image → springs → equilibrium }, rematched on the deformed mesh.

#include "registration/pipeline.hpp"

#include "registration/detail/doubts.hpp"
#include "registration/detail/engine_choice.hpp"
#include "registration/detail/evidence_set.hpp"
#include "registration/detail/ground.hpp"
#include "registration/detail/load_finder.hpp"
#include "registration/detail/loads.hpp"
#include "registration/detail/pace.hpp"
#include "registration/detail/rigid_part.hpp"
#include "registration/detail/stopwatch.hpp"
#include "registration/detail/surroundings.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace tissuewarp::registration {

namespace {

/// Search range of a round: geometric from the first to the last.
double range_of(const UpdateOptions& options, int round) {
    if (options.rematches < 2) return options.last_range_mm;
    const double t = std::min(1.0, double(round) / (options.rematches - 1));
    return options.first_range_mm * std::pow(options.last_range_mm / options.first_range_mm, t);
}

void append(std::vector<tled::Spring>& springs, const std::vector<tled::Spring>& others) {
    springs.insert(springs.end(), others.begin(), others.end());
}

/// The rounds of matching and equilibrium.
class Rematching {
public:
    Rematching(const PreparedModel& prepared, tled::Engine& engine, detail::EvidenceSet& evidence,
               detail::LoadFinder& load_finder, const UpdateOptions& options, detail::Pace& pace, UpdateResult& result,
               Observer& observer)
        : prepared_(prepared),
          evidence_(evidence),
          load_finder_(load_finder),
          options_(options),
          pace_(pace),
          result_(result),
          observer_(observer),
          engine_(engine),
          equilibrium_(options.equilibrium),
          loads_(detail::nodal_forces(prepared, options.loads)),
          step_mm_(options.most_step_mm),
          state_{result.alignment.placement, Eigen::Matrix3Xd::Zero(3, prepared.rest.node_count)} {
        result_.engine = engine_.description();
    }

    /// Leaves the elastic displacement in the moving frame, 3 × N mm.
    Eigen::Matrix3Xd run() {
        const int last = options_.rematches - 1;
        int round = 0;
        pace_.begin_rounds();
        for (int done = 0; done < 2 * options_.rematches && round < options_.rematches; ++done) {
            search_image(round);
            const Round record = solve(round);
            observer_.checkpoint("registration", double(round + 1) / options_.rematches);
            pace_.lap();
            if (round < last && !pace_.room_for(2)) {
                result_.cut_short = !pace_.room_for(1);
                if (result_.cut_short) break;
                round = last;
                continue;
            }
            if (50 * record.held_back > record.matched) continue;  // more than 2 %: the same range once more
            const bool settled =
                record.largest_change_mm < (searches_left() ? settled_for_search_mm() : options_.settled_mm);
            round = settled ? std::max(round + 1, next_milestone(round)) : round + 1;
        }
        search_on();
        explain_by_loads();
        settle_contact();
        result_.times.push_back({"correspondence", matching_seconds_});
        result_.times.push_back({"equilibrium", solving_seconds_});
        if (finding_seconds_ > 0) result_.times.push_back({"unknown loads", finding_seconds_});
        result_.alignment.placement = state_.placement;
        judge();
        return state_.displacement;
    }

private:
    const PreparedModel& prepared_;
    detail::EvidenceSet& evidence_;
    detail::LoadFinder& load_finder_;
    const UpdateOptions& options_;
    detail::Pace& pace_;
    UpdateResult& result_;
    Observer& observer_;
    tled::Engine& engine_;
    tled::EquilibriumOptions equilibrium_;
    Eigen::Matrix3Xd loads_;  // mN, 3 × N
    double load_size_ = 0;    // of those among them that were found
    double step_mm_;
    detail::State state_;
    /// Data other than labels pull with other springs than those that the model was prepared with: what relaxes
    /// slowest, and what a factor would be of, follow from them.
    std::optional<tled::RestStiffness> metric_;
    bool metric_is_current_ = false;
    bool relaxation_failed_ = false;
    double matching_seconds_ = 0, solving_seconds_ = 0, finding_seconds_ = 0;

    /// Points show the organ wherever it lies, and nothing says where that is.
    [[nodiscard]] bool placement_is_free() const {
        return evidence_.only_points() && options_.align && !evidence_.placed;
    }

    /// Springs that differ from those the model was prepared with, or few of which are the same.
    [[nodiscard]] bool needs_metric() const { return evidence_.image || evidence_.only_points() || evidence_.placed; }

    /// The searches of an image are spread over the rounds: those between only weigh the matches anew.
    [[nodiscard]] int round_of_search(int search) const {
        return search * options_.rematches / evidence_.image->searches();
    }
    [[nodiscard]] bool searches_left() const {
        return evidence_.image && evidence_.image->searches_done() < evidence_.image->searches();
    }

    /// A search looks farther than what is left to settle before it.
    [[nodiscard]] double settled_for_search_mm() const { return std::max(options_.settled_mm, 1.0); }

    /// Where rounds that change nothing any more go on: the next search, or the last round.
    [[nodiscard]] int next_milestone(int round) const {
        const int last = options_.rematches - 1;
        if (searches_left()) return std::min(last, round_of_search(evidence_.image->searches_done()));
        return round < last ? last : options_.rematches;
    }

    /// Tissue that blocks misplaced comes nearer by a voxel and a half with each dense search: searches go on while
    /// they bring the images into better agreement, each with two rounds that weigh what it found.
    void search_on() {
        constexpr int most_searches = 4;
        for (int done = 0; evidence_.image && evidence_.image->gains() && done < most_searches; ++done) {
            if (result_.cut_short || !pace_.room_for(2)) return;
            search();
            for (int round = 0; round < 2; ++round) solve(options_.rematches - 1);
            pace_.lap();
        }
    }

    /// What data show was done by loads that nobody stated; these also move what they do not show. A second time, since
    /// the first brings more points within reach. Where tissue does not bear them, it stays as it was without.
    void explain_by_loads() {
        constexpr int times = 2;
        const Eigen::Matrix3Xd stated = loads_;
        for (int time = 0; time < times && loads_are_looked_for(); ++time) {
            const detail::State state = state_;
            const UpdateResult result = result_;
            detail::Stopwatch stopwatch;
            const detail::FoundLoads found = find_loads();
            finding_seconds_ += stopwatch.lap("").seconds;
            try {
                loads_ = stated + found.forces;
                load_size_ = found.size;
                settle_loads();
            } catch (const SolverFailure& failure) {
                observer_.note(std::string("unknown loads are left out: ") + failure.what());
                state_ = state;
                result_ = result;
                return;
            }
        }
    }

    /// Half of a time budget is kept for what follows; nine tenths where labels are seen, since the rounds of their
    /// large models, begun again, are as long as those before.
    [[nodiscard]] bool loads_are_looked_for() const {
        const double kept = weight_is_unknown() ? 0.9 : 0.5;
        return (placement_is_free() || weight_is_unknown()) && options_.tissue.load_shapes > 0 && !result_.cut_short &&
               pace_.share_left() > kept;
    }

    /// Labels show the boundary all over, whatever presses on it there: what they do not show is a force within.
    [[nodiscard]] bool weight_is_unknown() const { return evidence_.labels && !evidence_.image && !evidence_.placed; }

    detail::FoundLoads find_loads() {
        if (!weight_is_unknown()) return load_finder_.find(detail::LoadKind::Smooth, result_.pulls, observer_);
        LastPulls pulls = result_.pulls;
        pulls.ground = detail::ground_springs(prepared_, evidence_.energy,
                                              [this](const InterfaceNode&) { return options_.tissue.free_motion_mm; });
        pulls.free_placement = true;
        return load_finder_.find(detail::LoadKind::Weight, pulls, observer_);
    }

    void settle_loads() {
        constexpr int most_rounds = 4;
        const int last = options_.rematches - 1;
        for (int done = 0; done < most_rounds; ++done) {
            const Round record = solve(done == 0 ? std::max(0, last - 1) : last);
            if (done > 0 && record.largest_change_mm < options_.settled_mm) break;
        }
    }

    /// Rounds that change the contact alone, until it is in balance.
    void settle_contact() {
        constexpr int most_rounds = 10;
        for (int done = 0; evidence_.contact && !evidence_.contact->settled(state_) && done < most_rounds; ++done)
            result_.rounds.push_back(attempt(options_.rematches - 1));
    }

    void search_image(int round) {
        if (searches_left() && round >= round_of_search(evidence_.image->searches_done())) search();
    }

    void search() {
        detail::Stopwatch stopwatch;
        evidence_.image->search(state_, observer_);
        metric_is_current_ = false;
        matching_seconds_ += stopwatch.lap("").seconds;
    }

    /// One round, kept.
    Round solve(int round) {
        const Round record = attempt(round);
        result_.rounds.push_back(record);
        if (placement_is_free()) detail::give_rigid_part_to_placement(prepared_, state_);
        return record;
    }

    /// One round; where the equilibrium fails, again with half the step bound.
    Round attempt(int round) {
        constexpr int most_halvings = 4;
        for (int halving = 0;; ++halving) {
            try {
                return match_and_solve(round);
            } catch (const SolverFailure& failure) {
                if (halving == most_halvings) throw;
                relaxation_failed_ |= equilibrium_.method == tled::EquilibriumMethod::SelfCheckedRelaxation;
                equilibrium_.method = options_.equilibrium.method;
                step_mm_ /= 2;
                observer_.note("a round is repeated with steps of at most " + detail::to_text(step_mm_) +
                               " mm: " + failure.what());
            }
        }
    }

    /// What the data say of the result.
    void judge() {
        evidence_.judge(state_, result_);
        if (!prepared_.options.anchors.empty()) result_.anchors = detail::anchor_fit(prepared_, state_);
    }

    [[nodiscard]] detail::RoundPlan plan_of(int round) const {
        const double range = range_of(options_, round);
        const double scale = round == 0 ? 1e6 : std::max(options_.residual_scale_mm, range / 3);
        return {round, round == options_.rematches - 1, range, scale, step_mm_};
    }

    /// The slowest mode is sought from that of the springs before, at first of those that the model was prepared with.
    void renew_metric(const tled::NodalConditions& conditions) {
        const tled::RestStiffness& before = metric_ ? *metric_ : prepared_.stiffness;
        metric_ =
            tled::RestStiffness(prepared_.rest, conditions, prepared_.stiffness, before.approximate_slowest_mode());
        metric_is_current_ = true;
    }

    /// Relaxation needs no factor; where it failed, L-BFGS with a factor of the data's own springs takes a handful of
    /// solves.
    void choose_method() {
        if (equilibrium_.method != tled::EquilibriumMethod::Automatic) return;
        if (!relaxation_failed_)
            equilibrium_.method = tled::EquilibriumMethod::SelfCheckedRelaxation;
        else if (metric_ && engine_.processor() == tled::Processor::Cpu)
            equilibrium_.method = tled::EquilibriumMethod::Lbfgs;
    }

    /// Nodes that entered a rigid neighbour touch it from then on: the round is solved again, with their springs.
    Round match_and_solve(int round, int most_passes = 4) {
        detail::Stopwatch stopwatch;
        const detail::RoundPlan plan = plan_of(round);
        detail::Contribution data = evidence_.contribution(plan, state_);
        result_.pulls = {data.conditions.springs,
                         data.holds,
                         evidence_.ground,
                         evidence_.supports(plan, state_),
                         state_.placement,
                         loads_,
                         evidence_.energy,
                         placement_is_free(),
                         load_size_};
        data.conditions.external_force = loads_;
        append(data.conditions.springs, result_.pulls.holds);
        append(data.conditions.springs, result_.pulls.ground);
        append(data.conditions.springs, result_.pulls.supports);
        const auto conditions = tled::nodal_conditions(data.conditions, prepared_.rest.node_count);
        Round record;
        record.range_mm = plan.range_mm;
        record.interface_nodes = data.candidates;
        record.matched = data.matched;
        record.held_back = data.held_back;
        record.mean_residual_mm = data.mean_residual_mm;
        matching_seconds_ += stopwatch.lap("").seconds;

        if (needs_metric() && !metric_is_current_) renew_metric(conditions);
        choose_method();
        const tled::EquilibriumResult solved =
            tled::equilibrium(engine_, metric_ ? *metric_ : prepared_.stiffness, conditions, equilibrium_,
                              &state_.displacement, observer_);
        equilibrium_.method = solved.method;  // chosen and explained once, not in every round
        equilibrium_.known_highest = solved.highest;
        record.largest_change_mm =
            std::sqrt((solved.displacement - state_.displacement).colwise().squaredNorm().maxCoeff());
        record.force_evaluations = solved.force_evaluations;
        record.estimated_error_mm = solved.estimated_error_mm;
        if (evidence_.contact && evidence_.contact->follow({state_.placement, solved.displacement}) &&
            most_passes > 1) {
            metric_is_current_ = false;
            solving_seconds_ += stopwatch.lap("").seconds;
            Round again = match_and_solve(round, most_passes - 1);
            again.force_evaluations += record.force_evaluations;
            return again;
        }
        state_.displacement = solved.displacement;
        result_.min_jacobian = solved.min_jacobian;
        solving_seconds_ += stopwatch.lap("").seconds;
        return record;
    }
};

}  // namespace

struct Updater::Impl {
    const PreparedModel& prepared;
    UpdateOptions options;
    std::unique_ptr<tled::Engine> solver;
    std::optional<detail::ImageTools> image_tools;  // where the model has an image
    detail::LoadFinder load_finder;

    Impl(const PreparedModel& model, const UpdateOptions& given, std::unique_ptr<tled::Engine> engine,
         Observer& observer)
        : prepared(model), options(given), solver(std::move(engine)), load_finder(model, given.tissue.load_shapes) {
        if (!model.image) return;
        image_tools.emplace(detail::ImageTools{
            detail::make_image_engine(model, given, observer), meshing::PointLocator(model.model.mesh), {}});
    }

    UpdateResult update(const Intraoperative& given, Observer& observer);
};

UpdateResult Updater::Impl::update(const Intraoperative& given, Observer& observer) {
    const Intraoperative seen = detail::without_neighbours(given, prepared.options.rigid_neighbours);
    detail::require_usable(prepared, seen);
    detail::Pace pace(options.time_budget_s);
    detail::Stopwatch stopwatch;
    UpdateResult result;
    detail::EvidenceSet evidence(prepared, seen, options, image_tools);
    if (options.align) result.alignment = detail::align(prepared, seen, evidence, options, observer);
    result.times.push_back(stopwatch.lap("rigid alignment"));
    if (seen.labels) evidence.labels.emplace(prepared, *seen.labels, options);
    result.times.push_back(stopwatch.lap("boundary maps"));

    const Eigen::Matrix3Xd displacement =
        Rematching(prepared, *solver, evidence, load_finder, options, pace, result, observer).run();
    result.deformation = {prepared.model.mesh, displacement, result.alignment.placement};
    result.doubts = detail::doubts(prepared, seen, result);
    return result;
}

Updater::Updater(const PreparedModel& prepared, const UpdateOptions& options, Observer& observer)
    : Updater(prepared, options, detail::make_engine(prepared, options, observer), observer) {}
Updater::Updater(const PreparedModel& prepared, const UpdateOptions& options, std::unique_ptr<tled::Engine> solver,
                 Observer& observer)
    : impl_(std::make_unique<Impl>(prepared, options, std::move(solver), observer)) {}
Updater::~Updater() = default;
Updater::Updater(Updater&&) noexcept = default;
Updater& Updater::operator=(Updater&&) noexcept = default;

UpdateResult Updater::update(const Intraoperative& seen, Observer& observer) {
    try {
        return impl_->update(seen, observer);
    } catch (const GpuUnavailable& failure) {
        if (impl_->options.device != Device::Auto) throw;
        observer.note(std::string("the CPU takes over, and the update begins again: ") + failure.what());
        UpdateOptions options = impl_->options;
        options.device = Device::Cpu;
        impl_ = std::make_unique<Impl>(impl_->prepared, options,
                                       detail::make_engine(impl_->prepared, options, observer), observer);
        return impl_->update(seen, observer);
    }
}

UpdateResult update(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                    Observer& observer) {
    return Updater(prepared, options, observer).update(seen, observer);
}

}  // namespace tissuewarp::registration
