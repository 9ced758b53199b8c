#pragma once
/// The same registration on a coarser mesh, for what varies smoothly and asks for a factor.

#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <Eigen/Core>

#include <array>

namespace tissuewarp::registration::detail {

/// When loads are found on a coarser model, and how points of one mesh are found in the other. Chosen by hand; on which
/// data is not recorded.
struct CoarseTwinOptions {
    int most_nodes_for_loads = 6000;  ///< of the model itself: a factor of a larger one takes long
    /// As PlaceOptions::outside: coarse meshes cut corners off.
    std::array<double, 4> outside{0.5, 1.0, 2.0, 4.0};
};
inline constexpr CoarseTwinOptions coarse_twin_options{};

/// The model of the same label map with other edges (mm), without anchors and rigid neighbours. Throws InvalidInput,
/// Cancelled.
PreparedModel coarse_model(const PreparedModel& prepared, double edge_length, Observer& observer);

/// Whether unknown loads are found on a coarser model, because they are smooth and a factor of this one takes long: it
/// has more than 6000 nodes.
bool loads_take_coarse_model(const PreparedModel& prepared);

/// Whether it will, as far as edges tell before the mesh is made: never where anchors or rigid neighbours hold the
/// organ.
bool loads_will_take_coarse_model(const imaging::Volume& organ, const PrepareOptions& options);

/// How that coarser model of an organ is prepared.
PrepareOptions coarse_options_for_loads(const imaging::Volume& organ, const PrepareOptions& options);

/// That model. The second is of a mesh that was made for it before. Throws InvalidInput, Cancelled.
PreparedModel coarse_model_for_loads(const PreparedModel& prepared, Observer& observer);
PreparedModel coarse_model_for_loads(const PreparedModel& prepared, meshing::TetMesh mesh, Observer& observer);

/// What pulls at a model, on the nodes of its coarse model nearby: springs and prior alone.
LastPulls pulls_on(const PreparedModel& coarse, const PreparedModel& prepared, const LastPulls& pulls);

/// Values at the nodes of `from` (C × N) at the places `to` (3 × P): between them, and of the nearest element outside.
Eigen::MatrixXd carried(const meshing::TetMesh& from, const Eigen::MatrixXd& nodal, const Eigen::Matrix3Xd& to);

/// The same at the nodes of a model of the same organ. Where tissue slides, each side's are those of its own side.
Eigen::MatrixXd carried(const PreparedModel& from, const Eigen::MatrixXd& nodal, const PreparedModel& to);

}  // namespace tissuewarp::registration::detail
