#pragma once
/// The cavity that a resection left, as an image of the operation shows it.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"
#include "registration/matching/points/field_of_view.hpp"
#include "registration/prepare.hpp"

#include <optional>

namespace tissuewarp::registration::detail {

/// uint8 on a grid about the wall of the hole that a deformed model leaves: what of an image (fixed frame, one
/// component) has no structure in the hole, up to its wall, which may lie beyond that of the hole by
/// CavityOptions::reach_mm. None where nothing in view is so.
std::optional<imaging::Volume> seen_cavity(const PreparedModel& prepared, const Deformation& deformation,
                                           const imaging::Volume& fixed, const FieldOfView& view);

}  // namespace tissuewarp::registration::detail
