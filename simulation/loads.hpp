#pragma once
/// What acts on the tissue of a scene at a time.

#include "simulation/build.hpp"

namespace tissuewarp::simulation {

/// What acts on the tissue of a stage at `time` (s), in the stage's own nodes: plainly, for any time.
tled::Conditions conditions_at(const BuiltScene& built, const Stage& stage, double time);

/// Direction and size of gravity at `time`, mm/s². The turn from `from` to its opposite goes about the axis across
/// them that is nearest to the z axis (or the y axis, where they lie along z).
Eigen::Vector3d gravity_at(const Gravity& gravity, double time, double duration);

/// The conditions of a stage as engines take them, brought to a time in place: what dynamics asks for every few steps.
class LoadsInTime {
public:
    /// Holds references.
    LoadsInTime(const BuiltScene& built, const Stage& stage, double time);

    /// nodal_conditions(conditions_at(built, stage, time), stage.rest), without building lists again.
    const tled::NodalConditions& at(double time);

private:
    /// Weight, tractions, lift and what tissue left out does, which stay as they are while gravity and tractions stand.
    void change_dead_loads(double time);

    const BuiltScene& built_;
    const Stage& stage_;
    std::vector<Eigen::Index> pressure_faces_;  ///< of each pressure in this stage
    tled::NodalConditions conditions_;
    Eigen::Matrix3Xd image_load_;                   ///< mN, what the image's own weight and lift take off
    std::vector<Eigen::Matrix3Xd> traction_loads_;  ///< mN, of each traction where its curve is 1
    std::vector<double> traction_parts_;            ///< of the conditions
    Eigen::Vector3d gravity_;                       ///< mm/s², likewise
};

/// For how long (s) loads may be held so that no motion in one go, of a node or of any point of a body's surface,
/// exceeds a hundredth of the shortest edge and no load changes by more than a hundredth; the scene's duration where
/// nothing moves.
double hold_interval(const BuiltScene& built, const Stage& stage);

}  // namespace tissuewarp::simulation
