#pragma once
/// Both images in small cubes at places of a lattice: whether tissue may be gone, known in milliseconds.

#include "meshing/point_location.hpp"
#include "registration/deformation.hpp"
#include "registration/matching/points/field_of_view.hpp"
#include "registration/resection/without_structure.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

/// By hand: cavities of 3 ml hold fourteen places.
struct TissueCubesOptions {
    double apart_mm = 4;  ///< places of the lattice
};
inline constexpr TissueCubesOptions tissue_cubes_options{};

/// What the moving image shows in cubes of 27 points about the places that lie in the model at rest; made once for all
/// updates.
class TissueCubes {
public:
    /// Of an image of one component.
    TissueCubes(const meshing::TetMesh& mesh, const meshing::PointLocator& locator, const imaging::Volume& moving);

    /// Whether the rule of tissue_gone() finds anything at these places: it itself takes longer than an update.
    [[nodiscard]] bool may_be_gone(const Deformation& deformation, const imaging::Volume& fixed,
                                   const FieldOfView& view) const;

private:
    struct Cube {
        std::int64_t voxel;     // of the lattice
        Eigen::Vector3d place;  // at rest, LPS mm
        meshing::Location in_mesh;
    };

    std::vector<Cube> cubes_;
    CavityView moving_;
};

}  // namespace tissuewarp::registration::detail
