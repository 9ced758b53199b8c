#pragma once
/// What total Lagrangian dynamics computes once, in the rest configuration (Miller et al. 2007, section 3):
/// shape-function derivatives, volumes, lumped mass, and the lists by which nodes gather forces.

#include "tled/model.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled {

/// Elements [begin, end) of the internal order share one material.
struct MaterialBlock {
    int material = 0;  ///< index into RestState::materials
    int begin = 0, end = 0;
};

/// Node-to-element lists in compressed form: entries [offset[a], offset[a+1]), ascending, in the internal element
/// order, are 4·element + corner where nothing else is said.
struct Incidence {
    std::vector<int> offset, entry;
};

/// Nodes of the averaged pressure: one for each (node, material) pair, so that pressure may jump at an interface. In
/// the order of their materials, then of the nodes.
struct PressureNodes {
    Eigen::Matrix4Xi of_element;  ///< 4 × M, pressure node of each corner
    Eigen::VectorXd volume;       ///< V_a = Σ ¼ V_e, mm³
    Eigen::VectorXd modulus;      ///< M_a of the material, kPa
    std::vector<int> material;    ///< index into RestState::materials, ascending
    Incidence incidence;          ///< pressure node → 4·element + corner
    [[nodiscard]] int count() const { return static_cast<int>(volume.size()); }
};

/// Per-element arrays are in the internal order: grouped by material, otherwise as in the mesh.
struct RestState {
    std::vector<Material> materials;     ///< without repetition (viscosity included), equal laws adjacent
    std::vector<PronySeries> viscosity;  ///< of each material; empty where none is viscous
    std::vector<MaterialBlock> blocks;   ///< one for each material that has elements
    std::vector<int> tet;                ///< M, internal position → tetrahedron of the mesh
    Eigen::Matrix4Xi nodes;              ///< 4 × M
    Eigen::Matrix<double, 9, Eigen::Dynamic>
        gradient;                        ///< 9 × M: row 3k+j is ∂N_{k+1}/∂X_j, 1/mm; N_0 = −Σ of the others
    Eigen::VectorXd volume;              ///< M, mm³
    Eigen::VectorXd volumetric_modulus;  ///< M, the part evaluated in the element, kPa: all of it for T4, none for
                                         ///< averaged pressure
    Eigen::Matrix3Xd fibre;              ///< 3 × M, unit vectors; empty where no material has fibres
    Eigen::VectorXd lumped_mass;         ///< N, kg
    Incidence incidence;                 ///< node → 4·element + corner
    PressureNodes pressure;              ///< empty for T4
    Eigen::Matrix3Xd position;           ///< 3 × N, mm
    int node_count = 0;

    [[nodiscard]] int element_count() const { return static_cast<int>(tet.size()); }
};

/// Index into RestState::materials of every element.
std::vector<int> material_of_elements(const RestState& rest);

/// Element::AveragedPressureT4 where the model averages its pressure.
Element element_of(const RestState& rest);

/// Whether every material's energy is finite for det F ≤ 0.
bool admits_inversion(const RestState& rest);

/// Throws InvalidInput through require_valid(model).
RestState rest_state(const Model& model);

}  // namespace tissuewarp::tled
