#pragma once
/// Effects in the form that engines take, and what they do, plainly: the slow twin of every engine.

#include "tled/effects.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <optional>
#include <vector>

namespace tissuewarp::tled {

/// Effects whose force on a node depends on where others are. `node` lists all nodes that any of them moves; lists of
/// entries are by place in `node`, offset[i] … offset[i + 1].
struct SurfaceEffects {
    std::vector<int> node;  ///< S, ascending

    Eigen::Matrix3Xi pressure_faces;
    Eigen::VectorXd pressure;      ///< kPa, of each of these faces
    Incidence pressure_incidence;  ///< entries 3·face + corner

    Eigen::Matrix3Xi membrane_faces;
    Eigen::Matrix3Xd membrane_rest;  ///< (D⁻¹)₀₀, (D⁻¹)₀₁, (D⁻¹)₁₁ of D = [X₁ − X₀, X₂ − X₀] in the face's plane, with
                                     ///< X₁ − X₀ along its first axis; 1/mm
    Eigen::VectorXd membrane_stiffness;  ///< μ times the sheet's volume on the face, mN mm
    Incidence membrane_incidence;        ///< entries 3·face + corner

    std::vector<SlidingPair> sliding;
    Incidence sliding_incidence;  ///< entries 2·pair + (0: first, 1: second)

    std::vector<SlidingPair> parting;
    Incidence parting_incidence;  ///< likewise

    [[nodiscard]] bool empty() const { return node.empty(); }
};

/// The force on node a is weight_a · clamp(½ + (level − height_a − up·u_a) / column_a, 0, 1) up.
struct NodalFluid {
    Eigen::Vector3d up;
    double level = 0.0;             ///< mm
    Eigen::VectorXd rest_height;    ///< N, up·X, mm
    Eigen::VectorXd weight;         ///< N, of the fluid that the node displaces, mN
    Eigen::VectorXd column_height;  ///< N, cube root of the node's volume, mm
};

/// How little of an obstacle's grid must be read where contact is far (tled/model/interpolation_reach.hpp).
struct GridReach {
    double interpolation = 0;  ///< mm
    double steepness = 0;      ///< mm/mm
    double tangent = 0;        ///< mm
};

struct NodalContact {
    std::vector<int> node;           ///< ascending
    Eigen::Matrix3Xd rest_position;  ///< 3 × as many, mm
    std::vector<Obstacle> obstacles;
    std::vector<GridReach> reach;  ///< of the obstacles, wherever they are
};

struct NodalEffects {
    SurfaceEffects surface;  ///< empty where nothing acts
    std::optional<NodalFluid> fluid;
    std::optional<NodalContact> contact;
};

/// Throws InvalidInput on nodes out of range, faces without area, numbers that are not finite or have no meaning.
NodalEffects nodal_effects(const Effects& effects, const RestState& rest);

/// g of a pair, mm: how far it overlaps, negative where it is apart.
double overlap(const SlidingPair& pair, const Eigen::Matrix3Xd& u);

/// The same effects with every pair that may part decided: those of `closed` hold together, the others are absent.
SurfaceEffects with_pairs_decided(const SurfaceEffects& effects, const std::vector<bool>& closed);

/// Force of pressures, membranes and pairs on every node at displacement `u` (3 × N, mm), mN, 3 × N.
Eigen::Matrix3Xd surface_force(const SurfaceEffects& effects, const Eigen::Matrix3Xd& position,
                               const Eigen::Matrix3Xd& u);
/// Lift on every node, mN, 3 × N.
Eigen::Matrix3Xd fluid_force(const NodalFluid& fluid, const Eigen::Matrix3Xd& u);
/// Energy whose negative gradient these forces are, mN mm, zero at rest; of a pressure where its surface is closed or
/// its rim does not move.
double energy(const NodalEffects& effects, const Eigen::Matrix3Xd& position, const Eigen::Matrix3Xd& u);

/// Distance to the obstacle's surface and its gradient by cubic convolution (Keys 1981) of the samples; +∞ and zero
/// outside the grid less its outermost samples.
struct Distance {
    double value = 0.0;        ///< mm
    Eigen::Vector3d gradient;  ///< not normalised
};
Distance distance_to(const Obstacle& obstacle, const Eigen::Vector3d& position);

/// What contact adds to displacement and increment of a node `depth` (mm) inside an obstacle of outward unit normal
/// `normal`; v is the increment less that of the obstacle (mm).
Eigen::Vector3d contact_correction(const Eigen::Vector3d& normal, double depth, double friction,
                                   const Eigen::Vector3d& v);

/// A node at rest position X that a step of `time_step` (s) has brought to displacement u by the increment v, after
/// contact with all obstacles in turn.
struct Motion {
    Eigen::Vector3d u, v;
};
Motion in_contact(const std::vector<Obstacle>& obstacles, const Eigen::Vector3d& X, const Motion& free,
                  double time_step);

}  // namespace tissuewarp::tled
