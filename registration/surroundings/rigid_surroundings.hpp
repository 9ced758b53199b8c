#pragma once
/// What lies around the organ and did not move with it: bone.
///
/// A field must continue beyond the organ, and whatever continues it smoothly bends the skull beside a craniotomy.
/// Where both images are at hand they tell how the surroundings moved as a whole, which the rigid placement of an organ
/// that deformed is only near to, and what of them moved so exactly: around every place the intraoperative image as
/// that motion carries it is compared with itself shifted along the displacement that the continuation adds, each by
/// what is left of the preoperative image after the best linear map of intensities in a window (as local correlation,
/// so contrast and brightness may differ). A place is rigid where the least of that lies nearer to the motion than to
/// the continuation. Places without structure say nothing and are left to the continuation. Whether the organ slid
/// along its surroundings the images tell likewise (organ_slid.hpp).

#include "registration/field.hpp"
#include "registration/result.hpp"

namespace tissuewarp::registration {

inline constexpr const char* sliding_note =
    "the images show that the organ slid along what lies around it, which is not dragged along but for 4 mm beside it";

/// How the surroundings moved, with the voxels of the moving image's grid that are rigid; those of
/// `deformation.surroundings` among them. None of them lies in the organ, before or after it deformed. Only what
/// `deformation` has where an image has several components or fewer than two voxels along an axis, where no rigid
/// motion explains the surroundings, or where the organ did not slide and moved against them by more than 8 mm in the
/// mean. Notes that the organ slid. Throws InvalidInput where the deformation is not usable.
std::optional<Surroundings> rigid_surroundings(const Deformation& deformation, const imaging::Volume& moving,
                                               const imaging::Volume& fixed, const FieldOptions& options = {},
                                               Observer& observer = silent_observer());

/// Bodies that are known to be rigid, of a label map in the moving frame: those whose motion labels show, at most 253,
/// and the others, with the placement. Without what the organ covers, before or after it deformed.
Surroundings rigid_bodies(const imaging::Volume& labels, const std::vector<BodyMotion>& seen,
                          const Deformation& deformation);

}  // namespace tissuewarp::registration
