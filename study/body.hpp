#pragma once
/// Bodies whose deformation is a question of numerics alone. What holds and moves them is a function of position, so
/// that meshes of every size solve the same problem, and errors are those at fixed places.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"
#include "study/setting.hpp"
#include "tled/conditions.hpp"
#include "tled/reference/quadratic.hpp"

#include <Eigen/Core>

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::study {

/// What pulls at a place of the surface.
struct Pull {
    double weight = 0;                                       ///< 0: nothing, 1: in full
    Eigen::Vector3d displacement = Eigen::Vector3d::Zero();  ///< where to, mm
};

/// Planes through `centre` across all three axes in which body, pulls and answer are mirrored; the centre moves by
/// `displacement` (mm).
struct Symmetry {
    Eigen::Vector3d centre, displacement;
};

struct Body {
    std::string name, story;
    std::function<meshing::TetMesh(int tetrahedra, Observer&)> mesh;  ///< nearly so many
    Hold hold = Hold::Hard;  ///< of the base: hard where the held part ends where meshes can follow it
    std::function<Pull(const Eigen::Vector3d& X)> pull;  ///< at a rest position of the surface, mm
    Eigen::Matrix3Xd samples;                            ///< rest positions inside, mm, where errors are measured
    std::optional<Symmetry> symmetry;
    /// Of the part with no coordinate above the symmetry's centre, or of the whole body, for quadratic tetrahedra.
    std::function<meshing::TetMesh(int tetrahedra, Observer&)> reference_mesh;
};

/// Edge 100 mm, the ends z = 0 and z = 100 mm held and drawn 20 mm apart (Taylor, Cheng, Ourselin 2007).
Body stretched_cube();

/// All labels but 0 of a map as one tissue, its surface in the lowest tenth held and dented by 10 mm where it lies
/// furthest to the front and above: the scene of the same paper, with a dent that ends smoothly within 40 mm. In organs
/// lower than 100 mm all lengths shrink alike.
Body indented_organ(const imaging::Volume& label_map);

/// What acts on linear tetrahedra: imposed displacements on boundary faces
/// pulled at in their corners and their middle, or springs there of 3 kPa/mm times the weight.
tled::Conditions conditions_of(const Body& body, Hold hold, const meshing::TetMesh& mesh);
/// The same on quadratic tetrahedra with straight edges, of the symmetric part where there is one; `linear` is the mesh
/// of their corners. Springs act by the rule of the edges' middles, exact to second degree.
tled::Conditions conditions_of(const Body& body, Hold hold, const meshing::TetMesh& linear,
                               const tled::QuadraticMesh& mesh);

}  // namespace tissuewarp::study
