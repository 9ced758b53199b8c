#pragma once
/// Labels of a preoperative map that are no tissue to deform, tissue that stays, or tissue that is gone.

#include "registration/intraoperative.hpp"
#include "registration/prepare.hpp"

#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

struct NeighbourOptions {
    double smoothing_voxels =
        0.7;  ///< standard deviation, of the distance to rigid neighbours: where their boundary is
              ///< oblique to the grid its steps turn normals. Chosen by hand; data not recorded
};

/// mm to the nearest voxel ≠ 0 of a map of integers, negative within, float32: that to midpoints between voxels is
/// rough where the boundary is oblique to the grid, and so would be normals.
imaging::Volume smooth_distance(const imaging::Volume& labels);

/// The bodies of these labels, none where no label is given. Precondition: require_surroundings.
std::optional<RigidNeighbours> rigid_neighbours(const imaging::Volume& map, const std::vector<int>& labels);

/// Rigid neighbours, and what is gone.
std::vector<int> not_meshed(const PrepareOptions& options);

/// The map without all labels but these, int32; empty where no label is given.
imaging::Volume labels_alone(const imaging::Volume& map, const std::vector<int>& labels);

/// All kinds of labels in one map again, as `prepare` takes it.
imaging::Volume with_neighbours(const PreparedModel& prepared);

/// What was seen with the rigid neighbours taken out of its labels, if it has any: they are background there as they
/// are in the model.
Intraoperative without_neighbours(const Intraoperative& seen, const std::vector<int>& labels);

}  // namespace tissuewarp::registration::detail
