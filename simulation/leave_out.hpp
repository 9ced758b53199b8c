#pragma once
/// Tissue far from the probes, in place of which springs act.

#include "core/observer.hpp"
#include "tled/conditions.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::simulation {

struct BuiltScene;

/// What is left out of a scene. Nodes and tetrahedra are those of the scene's mesh.
struct LeftOut {
    std::vector<bool> keep;            ///< tetrahedra that are simulated
    int tetrahedra = 0;                ///< left out
    double estimated_change_mm = 0.0;  ///< at the probes, between the linear answers of part and whole at the end
    std::vector<tled::Spring> springs;
    std::vector<int> nodes;               ///< on which the forces act
    std::vector<double> times;            ///< s, ascending
    std::vector<Eigen::Matrix3Xd> force;  ///< mN, at these times
};

/// The most tissue that may be left out by Scene::leave_out: all but what is nearest to the probes and what a pressure,
/// a membrane, growth, sliding or a body in contact acts on. The linear answers must foretell a fifth of the tolerance.
/// None where even a quarter of the tissue cannot be spared. `built` is whole.
std::optional<LeftOut> left_out(const BuiltScene& built, Observer& observer);

/// At LeftOut::nodes at a time (s), between those that are known linearly, mN.
Eigen::Matrix3Xd far_force(const LeftOut& left_out, double time);

/// "300 of 1000 tetrahedra are left out: …", for people.
std::string text_of(const LeftOut& left_out);

}  // namespace tissuewarp::simulation
