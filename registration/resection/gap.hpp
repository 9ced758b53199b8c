#pragma once
/// The hole that tissue leaves which is gone.
///
/// Fields are continued through it smoothly, as they are beyond the organ, since programs that read them invert them;
/// they mean nothing there. These masks say where.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"
#include "registration/result.hpp"

#include <Eigen/Core>

#include <optional>
#include <vector>

namespace tissuewarp::registration {

/// uint8 on the grid of `fixed_to_moving` (a field of the deformation): 1 where nothing of the model lies and the field
/// leads to what is gone (label map, ≠ 0, moving frame; PreparedModel::resected). Throws InvalidInput as warp_labels.
imaging::Volume gap_after(const Deformation& deformation, const imaging::Volume& resected,
                          const imaging::Volume& fixed_to_moving);

/// Sets voxels of the gap, which lies on the same grid, in all components to `value`, saturated to the voxels' type.
void leave_gap(imaging::Volume& volume, const imaging::Volume& gap, double value = 0);

/// `resected.filled` where the fixed label map, on the grid of the gap, shows tissue in much of it.
std::optional<Doubt> doubt_of_gap(const imaging::Volume& gap, const imaging::Volume& fixed_labels);

/// Which points (3 × P, LPS mm, moving frame) lie in what is gone and not in the model.
std::vector<bool> points_gone(const Deformation& deformation, const imaging::Volume& resected,
                              const Eigen::Matrix3Xd& points);

}  // namespace tissuewarp::registration
