#pragma once
/// What is simulated: tissue, without loads and without a place to run it.

#include "meshing/tet_mesh.hpp"
#include "tled/material.hpp"
#include "tled/viscosity.hpp"

namespace tissuewarp::tled {

enum class Element {
    T4,                  ///< linear tetrahedron; locks as ν → 0.5
    AveragedPressureT4,  ///< linear tetrahedron, volumetric energy of nodal volumes (docs/method.md, 2)
};

struct Model {
    meshing::TetMesh mesh;
    MaterialTable materials;  ///< one entry for every label of the mesh
    Element element = Element::AveragedPressureT4;
    double density = 1e-6;     ///< kg/mm³
    ViscosityTable viscosity;  ///< of labels that are not elastic; for dynamics
    Eigen::Matrix3Xd fibre;    ///< 3 × elements, unit vectors that replace those of the materials; or empty
};

/// Throws InvalidInput when a label has no material, a modulus is not positive, or the mesh is invalid.
void require_valid(const Model& model);

/// The model after all viscous stress has relaxed: elastic, with 1 − Σ g of the shear stress. What a static equilibrium
/// of tissue that has had time is computed with.
Model relaxed(Model model);

/// AveragedPressureT4 when any material has ν > 0.46, T4 otherwise: below, T4 hardly locks, and its factor is three
/// times smaller (docs/decisions/rest_stiffness.md).
Element suggested_element(const MaterialTable& materials);

}  // namespace tissuewarp::tled
