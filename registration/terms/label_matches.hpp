#pragma once
/// One round of correspondence: interface nodes of the deformed mesh to the boundaries of the fixed labels.

#include "registration/boundary/label_boundary_field.hpp"
#include "registration/springs/label_springs.hpp"
#include "registration/terms/term.hpp"

namespace tissuewarp::registration::detail {

/// Matches every interface node of the deformed mesh to the fixed boundary along its normal, where that boundary's own
/// normal lies within `max_angle_deg` of it, but to none where the fixed image ends. `normals`: one column per
/// interface node, moving frame.
std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed,
                                    const imaging::Geometry& fixed_grid, const State& state,
                                    const Eigen::Matrix3Xd& normals, const RoundPlan& plan, double max_angle_deg);

struct StrayOptions {
    /// Change of displacement per distance at rest, from which on a match is taken for another fold of the surface.
    /// Chosen among 0.5 to 1.5 and none on the brain sag with 45 labels and the lung's masks
    /// (docs/decisions/label_weights.md).
    double steepest = 0.75;
};
inline constexpr StrayOptions stray_options{};

/// Leaves out each match that would part its node from those about it (Interfaces::neighbours): along its normal the
/// node would lie further on than the median of them, by more than three quarters of their mean distance at rest.
/// Tissue is hardly strained so within two edges; a search that runs into the next fold of the surface asks for it.
/// `nodes` of the mesh at rest and `displacement`: 3 × N; `normals`: one column per interface node, moving frame.
void leave_out_strays(std::vector<Match>& matches, const Interfaces& interfaces,
                      const std::vector<std::vector<int>>& neighbours, const Eigen::Matrix3Xd& nodes,
                      const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& normals);

/// Weighs each match by how far its distance is from the median of its neighbours' (Interfaces::neighbours), by Huber's
/// function: 1 up to the scale, then the scale over that deviation (Huber, Ann Math Statist 35 (1964) 73). Where tissue
/// resists, matches are off together with those about them; where a label map is wrong, alone.
void weigh(std::vector<Match>& matches, const std::vector<std::vector<int>>& neighbours, double scale_mm);

/// No match asks for more than `most_step_mm`.
void bound(std::vector<Match>& matches, double most_step_mm);

/// Weighted mean of |distance|, mm.
double mean_residual(const std::vector<Match>& matches);

}  // namespace tissuewarp::registration::detail
