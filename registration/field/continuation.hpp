#pragma once
/// A nodal field of a mesh, continued to all of space.

#include "meshing/tet_mesh.hpp"
#include "registration/field/held_bodies.hpp"

#include <memory>

namespace tissuewarp::registration::detail {

/// The grid outside the organ and how it is solved on. Chosen by hand; on which data is not recorded.
struct ContinuationOptions {
    double finest_spacing_mm = 2.5;  ///< finer grids change the field by less than the layer corrects
    double spacings_of_fade = 4.0;   ///< in the fade distance, at least
    double most_nodes = 1.2e6;       ///< larger organs get a coarser grid
    double stiffening = 0.2;         ///< |∇u| from which the continuation resists steeper gradients
    double least_share = 0.01;       ///< of a value that would lead into rigid surroundings, that it is shortened by
    double blend_spacings = 1.25;    ///< thickness of the correcting layer at the surface, in grid spacings
    double slip_mm = 4;              ///< thickness of the layer that shears where the surface slides
    int coarsest_nodes = 16;         ///< along the shortest side of a grid that is not coarsened any more
    int coarsest_rounds = 20, rounds = 4, sweeps = 3;  ///< of weights, there and elsewhere; sweeps under each
    float relaxation = 1.4F;                           ///< factor of over-relaxation
};

/// Vectors at the nodes of a mesh (3 × N, mm): what is continued, and what its surface has beyond that where it slides
/// along what lies beside it (empty: nothing).
struct NodalField {
    Eigen::Matrix3Xd beside, slip = {};
};

/// Continues nodal vectors (mm) outward from the surface of a mesh, down to zero `fade_mm` away.
///
/// The continuation minimises ∫ ½ |∇u|² + |∇u|⁴ / (4 s²): harmonic where gradients are small against s = 0.2, and of
/// less slope than harmonic functions where those would fold, beside edges and narrow bumps. It is solved on a regular
/// grid of 2.5 mm or more, whose nodes inside the mesh hold the finite-element field. Trilinear interpolation cuts the
/// corner where the gradient jumps at the surface; what it misses at the closest surface point is added within a few
/// millimetres of the surface, so that the field is continuous there. In that layer and on the grid the continuation
/// also approximates the field inside the mesh, which the inversion of a continued field needs close to the surface.
///
/// Nodes of the grid in rigid bodies move with them.
///
/// Where the surface slides a layer shears: a jump would fold on any grid of voxels, whose steps are not along it.
class Continuation {
public:
    /// `nodes` 3 × N mm, positions of the mesh whose elements and outer boundary are given.
    Continuation(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets, const meshing::BoundarySurface& boundary,
                 const NodalField& field, double fade_mm, const HeldBodies& bodies = {},
                 double finest_spacing_mm = ContinuationOptions().finest_spacing_mm);
    ~Continuation();
    Continuation(Continuation&&) noexcept;
    Continuation& operator=(Continuation&&) noexcept;

    /// The value at a point (mm, the frame of `nodes`). Thread-safe.
    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& point) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::registration::detail
