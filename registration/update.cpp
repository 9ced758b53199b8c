#include "registration/update.hpp"

#include "core/stopwatch.hpp"
#include "imaging/labels.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/course/go_on.hpp"
#include "registration/engine_choice.hpp"
#include "registration/pose/start_pose.hpp"
#include "registration/register.hpp"
#include "registration/resection/tissue_cubes.hpp"
#include "registration/surroundings/rigid_surroundings.hpp"

#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::registration {

namespace {

std::vector<detail::ImageTools> image_tools_of(const PreparedModel& prepared, const UpdateOptions& options,
                                               Observer& observer) {
    if (!prepared.image) return {};
    const meshing::TetMesh& mesh = prepared.model.mesh;
    const auto locator = std::make_shared<const meshing::PointLocator>(mesh);
    std::vector<detail::ImageTools> tools;
    const auto add = [&](const ImageModel& image) {
        tools.push_back({detail::make_image_engine(mesh, image, options, observer),
                         locator,
                         {},
                         std::make_shared<const detail::TissueCubes>(mesh, *locator, image.image)});
    };
    add(*prepared.image);
    for (const auto& contrast : prepared.contrasts) add(*contrast);
    return tools;
}

/// The result of an update that went on from another is not to be taken.
struct BeginAnew {
    std::string why;
};

}  // namespace

struct Updater::Impl {
    std::shared_ptr<const PreparedModel> prepared;
    UpdateOptions options, short_options;  // of whole courses, and of those that go on from a result
    std::unique_ptr<tled::Engine> solver;
    detail::SharedTools tools;
    detail::LoadFinder load_finder;

    Impl(std::shared_ptr<const PreparedModel> model, const UpdateOptions& given, std::unique_ptr<tled::Engine> engine,
         Observer& observer)
        : prepared(std::move(model)),
          options(given),
          short_options(detail::short_course(given)),
          solver(std::move(engine)),
          tools{image_tools_of(*prepared, options, observer), nullptr, nullptr},
          load_finder(*prepared, options.tissue) {}

    UpdateResult update(const Intraoperative& given, Observer& observer) {
        Stopwatch stopwatch;
        Seen seen = seen_by_model(given, observer);
        detail::Terms terms = detail::terms_of(*prepared, seen.data, options, tools, std::move(seen.bodies));
        const double seconds = stopwatch.lap();
        UpdateResult result = in_fixed_frame(
            detail::register_model(*prepared, terms, load_finder, *solver, options, observer), given, seconds);
        leave(result, {result.deformation.deformed_nodes(), detail::amount_seen(result), 0, {}});
        return result;
    }

    /// Throws BeginAnew where the result is not to be taken, or none was found.
    UpdateResult go_on(const UpdateResult& last, const Intraoperative& given, Observer& observer) {
        if (!detail::same_kinds(last, given)) throw BeginAnew{"other kinds of data are seen"};
        if (last.carried_on->since >= detail::go_on_limits.most_in_a_row)
            throw BeginAnew{"so many updates went on that the placement is sought again"};
        Stopwatch stopwatch;
        Seen seen = seen_by_model(given, observer);
        try {
            detail::Terms terms = detail::terms_of(*prepared, seen.data, short_options, tools, std::move(seen.bodies));
            const double seconds = stopwatch.lap();
            if (!terms.take_over(last)) throw BeginAnew{"the placement must be sought for such data"};
            const Eigen::Isometry3d placement = start_of(given).inverse() * last.alignment.placement;
            UpdateResult result = in_fixed_frame(
                detail::register_on(last, placement, *prepared, terms, load_finder, *solver, short_options, observer),
                given, seconds);
            if (const auto why = detail::why_begin_anew(last, result)) throw BeginAnew{*why};
            result.beginning = {true};
            const detail::CarriedOn& carried = *last.carried_on;
            leave(result, {carried.nodes, carried.seen, carried.since + 1, {}});
            return result;
        } catch (const SolverFailure& failure) {
            throw BeginAnew{failure.what()};
        } catch (const InvalidInput& failure) {  // nothing lies near, or all of it is at fault, which update() will say
            throw BeginAnew{failure.what()};
        }
    }

    void require_result_of_model(const UpdateResult& last) const {
        if (last.carried_on && last.deformation.mesh.nodes == prepared->model.mesh.nodes) return;
        throw InvalidInput("an update cannot go on from a result of another model, or of none");
    }

private:
    static Eigen::Isometry3d start_of(const Intraoperative& given) {
        return given.start.value_or(Eigen::Isometry3d::Identity());
    }

    /// To updates that go on from it, with the search for loads that the course ended with.
    static void leave(UpdateResult& result, detail::CarriedOn carried) {
        carried.loads = result.carried_on->loads;
        result.carried_on = std::make_shared<const detail::CarriedOn>(std::move(carried));
    }

    /// What the model is registered to, and bodies beside it.
    struct Seen {
        Intraoperative data;
        std::vector<detail::SeenBody> bodies;
    };
    [[nodiscard]] Seen seen_by_model(const Intraoperative& given, Observer& observer) const {
        Seen seen{given.start ? detail::seen_from(given, *given.start) : given, {}};
        if (prepared->neighbours && seen.data.labels)
            seen.bodies = detail::seen_bodies(*prepared->neighbours, *seen.data.labels, observer);
        seen.data = detail::without_neighbours(seen.data, prepared->options.rigid_neighbours);
        const bool bones_alone = !seen.bodies.empty() && imaging::labels_in(*seen.data.labels).empty();
        if (bones_alone) seen.data.labels.reset();
        return seen;
    }

    [[nodiscard]] UpdateResult in_fixed_frame(UpdateResult result, const Intraoperative& given,
                                              double boundary_maps_s) const {
        if (given.start) detail::return_to_fixed_frame(result, *given.start);
        for (BodyMotion& body : result.bodies)
            if (!body.own) body.motion = result.deformation.placement;
        if (prepared->neighbours)
            result.deformation.surroundings =
                rigid_bodies(prepared->neighbours->labels, result.bodies, result.deformation);
        result.times.insert(result.times.begin() + 1, {stages::boundary_maps, boundary_maps_s});
        return result;
    }
};

Updater::Updater(std::shared_ptr<const PreparedModel> prepared, const UpdateOptions& options, Observer& observer)
    : Updater(prepared, options, detail::make_engine(*prepared, options, observer), observer) {}
Updater::Updater(PreparedModel&& prepared, const UpdateOptions& options, Observer& observer)
    : Updater(std::make_shared<const PreparedModel>(std::move(prepared)), options, observer) {}
Updater::Updater(std::shared_ptr<const PreparedModel> prepared, const UpdateOptions& options,
                 std::unique_ptr<tled::Engine> solver, Observer& observer)
    : impl_(std::make_unique<Impl>(std::move(prepared), options, std::move(solver), observer)) {}
Updater::~Updater() = default;
Updater::Updater(Updater&&) noexcept = default;
Updater& Updater::operator=(Updater&&) noexcept = default;

void Updater::take_processor(const GpuUnavailable& failure, Observer& observer) {
    if (impl_->options.device != Device::Auto) throw;
    observer.note(std::string("the CPU takes over, and the update begins again: ") + failure.what());
    UpdateOptions options = impl_->options;
    options.device = Device::Cpu;
    const std::shared_ptr<const PreparedModel> prepared = impl_->prepared;
    impl_ = std::make_unique<Impl>(prepared, options, detail::make_engine(*prepared, options, observer), observer);
}

UpdateResult Updater::update(const Intraoperative& seen, Observer& observer) {
    try {
        return impl_->update(seen, observer);
    } catch (const GpuUnavailable& failure) {
        take_processor(failure, observer);
        return impl_->update(seen, observer);
    }
}

UpdateResult Updater::go_on(const UpdateResult& last, const Intraoperative& seen, Observer& observer) {
    impl_->require_result_of_model(last);
    Stopwatch stopwatch;
    std::string why;
    try {
        return impl_->go_on(last, seen, observer);
    } catch (const BeginAnew& reason) {
        why = reason.why;
    } catch (const GpuUnavailable& failure) {
        take_processor(failure, observer);
        why = failure.what();
    }
    const double seconds = stopwatch.lap();
    UpdateResult result = update(seen, observer);
    result.beginning = {false, why};
    add_time(result.times, stages::in_vain, seconds);
    return result;
}

UpdateResult update(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                    Observer& observer) {
    const std::shared_ptr<const PreparedModel> borrowed(std::shared_ptr<const PreparedModel>(), &prepared);
    return Updater(borrowed, options, observer).update(seen, observer);
}

}  // namespace tissuewarp::registration
