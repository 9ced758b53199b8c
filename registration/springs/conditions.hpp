#pragma once
/// What acts on the tissue of a model.

#include "registration/prepare.hpp"
#include "tled/conditions.hpp"

#include <utility>

namespace tissuewarp::registration::detail {

/// Conditions on the tissue of a model, which slides where it was prepared to. Throws as tled::nodal_conditions.
inline tled::NodalConditions conditions_on(const PreparedModel& prepared, tled::Conditions conditions) {
    conditions.effects.sliding = prepared.sliding;
    return tled::nodal_conditions(conditions, prepared.rest);
}

}  // namespace tissuewarp::registration::detail
