#pragma once
/// A boundary-value problem with reference values, written once for every mesh, element and law.

#include "meshing/tet_mesh.hpp"
#include "tled/conditions.hpp"
#include "tled/material.hpp"

#include <Eigen/Core>

#include <array>
#include <functional>
#include <string>
#include <vector>

namespace tissuewarp::verification {

enum class Law { Iso, LnJ };
inline const char* name_of(Law law) {
    return law == Law::Iso ? "iso" : "lnJ";
}

class Solution;

/// What is compared: one number, or many of one kind (components of displacements at points).
struct Quantity {
    std::string name, unit;
    Eigen::VectorXd reference, uncertainty;
    std::function<Eigen::VectorXd(const Solution&)> measure;
};

/// Dead load on the boundary faces whose corners all satisfy `on`, kPa.
struct Traction {
    std::function<bool(const Eigen::Vector3d& X)> on;
    Eigen::Vector3d value = Eigen::Vector3d::Zero();
};

/// Geometry, material, loads and quantities. Positions are rest positions in mm. A problem with symmetry planes is
/// posed on a part of the body; its quantities are those of the whole.
struct Problem {
    std::string name;  ///< as in data/reference
    Law law = Law::Iso;
    tled::MaterialTable materials;
    std::function<meshing::TetMesh(int level)> mesh;  ///< level: cells along a characteristic edge
    /// Where the middle node of the boundary edge a–b lies on a curved surface; empty for flat boundaries.
    std::function<Eigen::Vector3d(const Eigen::Vector3d& a, const Eigen::Vector3d& b)> middle;
    /// What is prescribed at a position, without the node. Where a load factor below 1 asks for another path than the
    /// straight one, `stage` counts from 1 to `stages`.
    std::function<tled::PrescribedDisplacement(const Eigen::Vector3d& X, int stage)> hold;
    int stages = 1;
    Eigen::Vector3d body_force = Eigen::Vector3d::Zero();  ///< mN/mm³ of rest volume
    std::vector<Traction> tractions;
    /// Height (mm) of a rigid frictionless plane at a stage: z + u_z ≤ height for the nodes at positions that
    /// `may_touch` it. Empty without contact.
    std::function<double(int stage)> plane_height;
    std::function<bool(const Eigen::Vector3d& X)> may_touch;
    /// Of the study with linear and with quadratic elements, from coarse to fine. Meshes of all levels have the same
    /// shape; their cells shrink alike in all directions.
    std::array<int, 4> levels{}, quadratic_levels{};
    std::vector<Quantity> quantities;
};

}  // namespace tissuewarp::verification
