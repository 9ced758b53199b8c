#pragma once
/// What acts on tissue where it is now: on its deformed surface, by its height, against rigid neighbours. A scene pays
/// for those that it holds. Springs, prescribed displacements and constant forces are in conditions.hpp; fibres,
/// viscosity and growth belong to the model.

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace tissuewarp::tled {

/// Pressure that follows the surface (insufflation): a deformed face of area a and outward normal n takes −p a n, a
/// third of it at each corner.
struct SurfacePressure {
    Eigen::Matrix3Xi faces;  ///< nodes, counter-clockwise seen from outside
    double pressure = 0.0;   ///< p, kPa; positive pushes inwards
};

/// A thin incompressible sheet of neo-Hookean material grown onto faces (dura, falx, capsule, skin), in plane stress:
/// W = μ/2 (tr C + 1/det C − 3) per volume of the sheet, C the right Cauchy–Green tensor in its plane (Bonet and Wood
/// 2008, section 6.6 with λ₃ = 1/√det C). It bends freely.
struct Membrane {
    Eigen::Matrix3Xi faces;
    double shear_modulus = 0.0;  ///< μ, kPa
    double thickness = 0.0;      ///< mm, at rest
};

/// Two nodes of surfaces that slide on one another, at one place at rest: energy ½ k g² of how far they overlap,
/// g = n·(u_first − u_second). Pairs that hold together have it for g < 0 too, pairs that may part have none there.
struct SlidingPair {
    int first = -1, second = -1;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< n, unit vector out of the surface of the first
    double stiffness = 0.0;                            ///< k, mN/mm
};

/// Fluid that lifts the tissue below its surface by the weight it displaces. A node counts as a column as high as its
/// volume's edge: submerged by the part of it that is below the level, so that the lift sets in without a jump.
struct Fluid {
    double density = 1e-6;                              ///< kg/mm³
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< mm/s²
    double level = 0.0;                                 ///< mm, of the surface above the origin, against gravity
};

/// Samples of a signed distance (mm, negative inside the obstacle) on a regular grid. There is no contact outside it.
struct DistanceGrid {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();     ///< of sample (0, 0, 0), mm, LPS
    Eigen::Matrix3d steps = Eigen::Matrix3d::Identity();  ///< columns: from a sample to the next along i, j, k, mm
    Eigen::Vector3i size = Eigen::Vector3i::Zero();       ///< samples along i, j, k; at least 4 each
    std::vector<float> distance;                          ///< mm, i fastest
};

/// A grid that is shared where it would be copied: it may hold megabytes, and its body moves with every change of
/// conditions.
class SharedGrid {
public:
    SharedGrid(DistanceGrid grid = {}) : grid_(std::make_shared<const DistanceGrid>(std::move(grid))) {}
    const DistanceGrid& operator*() const { return *grid_; }
    const DistanceGrid* operator->() const { return grid_.get(); }
    /// Whether it is the same grid, not one that is equal.
    bool operator==(const SharedGrid&) const = default;

private:
    std::shared_ptr<const DistanceGrid> grid_;
};

/// Where a rigid body is: its point that was sampled at X is at rotation · X + shift.
struct RigidPlacement {
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();         ///< mm
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< proper orthogonal
    bool operator==(const RigidPlacement&) const = default;
};

/// How a rigid body moves: its point at x has the velocity of_origin + spin × x.
struct RigidVelocity {
    Eigen::Vector3d of_origin = Eigen::Vector3d::Zero();  ///< mm/s, of the body's point at the origin of space
    Eigen::Vector3d spin = Eigen::Vector3d::Zero();       ///< rad/s
    bool operator==(const RigidVelocity&) const = default;
};

/// A rigid body that tissue cannot enter but can leave.
struct Obstacle {
    SharedGrid surface;
    RigidPlacement placement{};
    double friction = 0.0;     ///< Coulomb's coefficient
    RigidVelocity velocity{};  ///< for friction alone: what moves the body is its placement from one set of conditions
                               ///< to the next
};
/// Whether the velocity of any depends on the place.
bool turns(const std::vector<Obstacle>& obstacles);

/// Nodes of the tissue's surface that may touch the obstacles. In dynamics a node that enters one is put back onto its
/// surface within the step and loses the velocity towards it, and up to `friction` times as much of that along it,
/// which is relative to the body.
struct RigidContact {
    std::vector<int> nodes;
    std::vector<Obstacle> obstacles;
};

/// As scenes state them.
struct Effects {
    std::vector<SurfacePressure> pressures;
    std::vector<Membrane> membranes;
    std::vector<SlidingPair> sliding;  ///< that hold together
    std::vector<SlidingPair> parting;  ///< that press on one another or are apart
    std::optional<Fluid> fluid;
    std::optional<RigidContact> contact;
    [[nodiscard]] bool none() const {
        return pressures.empty() && membranes.empty() && sliding.empty() && parting.empty() && !fluid && !contact;
    }
};

}  // namespace tissuewarp::tled
