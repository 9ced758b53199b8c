#pragma once
/// The two scenes of Taylor, Cheng, Ourselin (2007): a stretched cube and an indented brain, of one tissue.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"
#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"

#include <vector>

namespace tissuewarp::apps {

/// Tetrahedra of neo-Hookean tissue (lnJ, λ = 49.329 kPa, μ = 1.007 kPa, 1000 kg/m³), what holds and moves it,
/// and the displacement (3 × N, mm) that the steps start from.
struct BenchScene {
    tled::RestState rest;
    tled::NodalConditions conditions;
    Eigen::Matrix3Xd start;
    [[nodiscard]] Eigen::Matrix3Xd mass() const { return rest.lumped_mass.transpose().replicate(3, 1); }
};

/// Edge 100 mm, `cells`³ cells of six tetrahedra, both ends held, 20 % further apart than at rest. It starts as a waist
/// of unchanged volume: an even stretch would release its pressure as waves that no step near the critical one
/// survives.
BenchScene stretched_cube(int cells, tled::Element element = tled::Element::T4);

/// The nodes around the surface point that lies furthest to the front and above are pressed in by 10 mm, those of the
/// lowest tenth are held; starts with the dent half settled.
BenchScene indented_brain(const meshing::TetMesh& mesh);

/// Cells an edge so that the cube has about so many elements.
int cells_for(int elements);

/// A mesh of the labels as one tissue with `elements` tetrahedra within three per cent, where a few tries reach that.
/// `labels` are those of tissue; empty: all but 0. Throws InvalidInput and Cancelled.
meshing::TetMesh brain_mesh(const imaging::Volume& label_map, const std::vector<int>& labels, int elements,
                            Observer& observer);

/// 2/ω (s) of the highest frequency, at rest or at the start, whichever is less (tled/critical_step.hpp).
double critical_step(const BenchScene& scene);

}  // namespace tissuewarp::apps
