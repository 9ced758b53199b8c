#pragma once
/// The method (docs/method.md).

#include "registration/loads/load_finder.hpp"
#include "registration/options.hpp"
#include "registration/terms/terms.hpp"
#include "tled/engine.hpp"

namespace tissuewarp::registration::detail {

/// Registers a prepared model to what its terms show. `loads` looks for those that nobody stated. Throws as
/// Updater::update.
UpdateResult register_model(const PreparedModel& prepared, Terms& terms, LoadFinder& loads, tled::Engine& engine,
                            const UpdateOptions& options, Observer& observer);

/// The same from where an earlier result ended: `placement` is its, in the frame of the terms' data, `options` and
/// terms are those of a short course (course/go_on.hpp). Precondition: the terms have taken over what the search for
/// the placement told.
UpdateResult register_on(const UpdateResult& last, const Eigen::Isometry3d& placement, const PreparedModel& prepared,
                         Terms& terms, LoadFinder& loads, tled::Engine& engine, const UpdateOptions& options,
                         Observer& observer);

}  // namespace tissuewarp::registration::detail
