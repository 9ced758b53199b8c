#pragma once
/// What holds and moves a random organ. All of it varies smoothly over the surface, so that the truth converges with
/// its mesh.

#include "study/detail/organ_shape.hpp"

#include "tled/conditions.hpp"
#include "tled/reference/quadratic.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace tissuewarp::study::detail {

/// A cap of the organ's surface: weight 1 in its middle, 0 from `radius_mm` on, ½ (1 + cos) between.
struct Cap {
    Eigen::Vector3d middle;  ///< LPS mm
    double radius_mm = 0;

    [[nodiscard]] double weight(const Eigen::Vector3d& point) const;
};

struct Pressure {
    Cap cap;
    double kpa = 0;  ///< along the inward normal at rest
};

/// An elastic bed that draws its cap to a displacement.
struct Bed {
    Cap cap;
    double stiffness = 0;                                    ///< kPa/mm
    Eigen::Vector3d displacement = Eigen::Vector3d::Zero();  ///< mm, in the middle; elsewhere times the weight
};

struct RandomLoads {
    Eigen::Vector3d body_force = Eigen::Vector3d::Zero();  ///< mN/mm³ of rest volume
    std::vector<Pressure> pressures;
    std::vector<Bed> held, pressed;
    std::string words;  ///< what there is of them
};

/// A mixture that moves tissue of a Young's modulus by some millimetres; `scaled` brings it to a size.
RandomLoads random_loads(const OrganShape& shape, double youngs_modulus_kpa, Random& random);

/// Of an organ whose hull is open over a cap, the only pressure, through which it bulges. A bed holds it elsewhere, the
/// less the nearer to the opening.
RandomLoads bulging_loads(const OrganShape& shape, double youngs_modulus_kpa, Random& random);

/// The loads times a factor; what is held stays held.
RandomLoads scaled(RandomLoads loads, double factor);

/// Faces of a mesh to the outside.
std::vector<meshing::InterfaceFace> outer_faces(const meshing::TetMesh& mesh);

/// On a mesh: springs with the consistent areas of its nodes, and nodal forces.
tled::NodalConditions conditions_on(const tled::QuadraticMesh& mesh, const meshing::TetMesh& corners,
                                    const OrganShape& shape, const RandomLoads& loads);
/// The same on these of the outer faces.
tled::NodalConditions conditions_on(const tled::QuadraticMesh& mesh, const meshing::TetMesh& corners,
                                    const std::vector<meshing::InterfaceFace>& faces, const OrganShape& shape,
                                    const RandomLoads& loads);

}  // namespace tissuewarp::study::detail
