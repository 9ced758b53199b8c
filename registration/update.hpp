#pragma once
/// During the operation: a prepared model is registered to what is seen, again and again.

#include "core/observer.hpp"
#include "registration/intraoperative.hpp"
#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <memory>

namespace tissuewarp::registration {

/// Registers one prepared model again and again. What the updates share is made once: the engine that solves, and on a
/// GPU the context, programs and images of the model.
class Updater {
public:
    /// The model is complete: it may be shared, and no longer changed. Throws GpuUnavailable when a GPU was demanded
    /// and there is none.
    explicit Updater(std::shared_ptr<const PreparedModel> prepared, const UpdateOptions& options = {},
                     Observer& observer = silent_observer());
    /// The same of a model that nobody else needs.
    explicit Updater(PreparedModel&& prepared, const UpdateOptions& options = {},
                     Observer& observer = silent_observer());
    /// The same with an engine of the caller's, made of `prepared->rest`.
    Updater(std::shared_ptr<const PreparedModel> prepared, const UpdateOptions& options,
            std::unique_ptr<tled::Engine> solver, Observer& observer = silent_observer());
    ~Updater();
    Updater(Updater&&) noexcept;
    Updater& operator=(Updater&&) noexcept;

    /// Registers the model to what was seen during the operation. Throws InvalidInput when there is nothing to register
    /// to, a bare volume without prepare_image before the updater was made, label maps that share no label or do not
    /// meet, surface points, pairs of points or curves that cannot be used or lie nowhere near the model; SolverFailure
    /// when no trustworthy equilibrium is found, GpuUnavailable when a device fails that was demanded. Where it was
    /// not, the processor does the update from its beginning and all later ones, with a note.
    UpdateResult update(const Intraoperative& seen, Observer& observer = silent_observer());

    /// The same from where an update of this model ended, in a fraction of the time: the placement is not sought, few
    /// rounds are taken, and loads are found with the springs of the last search for them. Where the outcome does not
    /// agree with `last` and with what is seen (why_begin_anew), or none can be found from there, the update is made
    /// from its beginning, and `beginning` says why. Throws what update() throws; InvalidInput where `last` is of
    /// another model.
    UpdateResult go_on(const UpdateResult& last, const Intraoperative& seen, Observer& observer = silent_observer());

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;

    /// After a device failed; throws what it threw where a GPU was demanded.
    void take_processor(const GpuUnavailable& failure, Observer& observer);
};

/// One update: Updater(prepared, options).update(seen).
UpdateResult update(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options = {},
                    Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
