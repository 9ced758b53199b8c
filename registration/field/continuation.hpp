#pragma once
/// A nodal field of a mesh, continued to all of space.

#include "meshing/tet_mesh.hpp"

#include <memory>

namespace tissuewarp::registration::detail {

/// Continues nodal vectors (mm) outward from the surface of a mesh, down to zero `fade_mm` away.
///
/// The continuation minimises ∫ ½ |∇u|² + |∇u|⁴ / (4 s²): harmonic where gradients are small against s = 0.2, and of
/// less slope than harmonic functions where those would fold, beside edges and narrow bumps. It is solved on a regular
/// grid of 2.5 mm or more, whose nodes inside the mesh hold the finite-element field. Trilinear interpolation cuts the
/// corner where the gradient jumps at the surface; what it misses at the closest surface point is added within a few
/// millimetres of the surface, so that the field is continuous there. In that layer and on the grid the continuation
/// also approximates the field inside the mesh, which the inversion of a continued field needs close to the surface.
class Continuation {
public:
    /// `nodes` 3 × N mm, positions of the mesh whose elements and outer boundary are given; `values` 3 × N, mm.
    Continuation(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets, const meshing::BoundarySurface& boundary,
                 const Eigen::Matrix3Xd& values, double fade_mm);
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
