#pragma once
/// What happens to the tissue, as plain data: a scene holds what it names and nothing more. Lengths mm, LPS; times s;
/// every load follows a curve of its own.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"
#include "simulation/curve.hpp"
#include "simulation/fibres.hpp"
#include "simulation/region.hpp"
#include "simulation/rigid_motion.hpp"
#include "tled/equilibrium.hpp"
#include "tled/model.hpp"

#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace tissuewarp::simulation {

/// Labels of a volume that have a tissue are meshed; the others are left out.
struct LabelledVolume {
    imaging::Volume labels;                     ///< int32
    double edge_length = 5.0;                   ///< mm
    std::map<int, double> label_edge_length{};  ///< mm
};

/// A box of tetrahedra, label 1, one corner at `lower`.
struct BoxGeometry {
    Eigen::Vector3d lower = Eigen::Vector3d::Zero();
    Eigen::Vector3d size = Eigen::Vector3d::Zero();
    std::array<int, 3> cells{0, 0, 0};  ///< of six tetrahedra each
};

/// Ellipsoids and boxes painted one over the other and meshed; label 0 cuts away.
struct Ellipsoid {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(), radii = Eigen::Vector3d::Zero();
};
struct Shape {
    int label = 1;
    std::variant<Ellipsoid, Box> solid;
};
struct ShapeGeometry {
    std::vector<Shape> shapes;
    double edge_length = 5.0;                   ///< mm; shapes are painted on voxels of a quarter of the shortest
    std::map<int, double> label_edge_length{};  ///< mm
};

using Geometry = std::variant<LabelledVolume, meshing::TetMesh, BoxGeometry, ShapeGeometry>;

struct Tissue {
    std::string name;
    tled::Material material;
    tled::PronySeries viscosity;  ///< for dynamics; an equilibrium takes what is left after long times
    /// g: unloaded, each length of the tissue becomes g times itself, over the length of the scene. On the way there
    /// the pressure of growth rises evenly and the moduli are those of the end (tled/growth.hpp, which names the laws).
    double growth = 1.0;
    FibreField fibres{};  ///< of a transversely isotropic material, in place of its one direction
};

/// Displacement components that stay zero.
struct Fixed {
    std::string set;
    std::array<bool, 3> axes{true, true, true};
};

/// Displacement components that are those of a rigid body, which moves along a curve.
struct Motion {
    std::string set;
    std::array<bool, 3> axes{true, true, true};
    RigidMotion motion{};  ///< all of it where the curve is 1
    Curve curve{};
};

/// Springs to the place at rest: an elastic foundation, of which each node has its share of the area, or ligaments,
/// which the nodes share evenly.
struct Springs {
    enum class Along { AllDirections, Normal };
    std::string set;
    double per_area = 0.0;  ///< kPa/mm; or
    double total = 0.0;     ///< N/m, which is mN/mm
    Along along = Along::AllDirections;
};

/// Weight. With `from` the image shows the tissue under gravity in that direction, and the load is the difference
/// between the present weight and that one: the direction turns from `from` to `to` by the curve's part of the angle.
/// Without, the image shows the unloaded tissue, and the weight along `to` grows with the curve.
struct Gravity {
    std::optional<Eigen::Vector3d> from;  ///< unit vector
    Eigen::Vector3d to = Eigen::Vector3d::Zero();
    double magnitude = 9810.0;  ///< mm/s²
    Curve curve{};
};

/// Fluid around and within the tissue whose level changes. With Gravity::from the image shows the tissue lifted at
/// level `from`, and the load is the difference.
struct FluidLevel {
    double density = 1e-6;        ///< kg/mm³
    double from = 0.0, to = 0.0;  ///< mm above the origin, against gravity
    Curve curve{};
};

struct Pressure {
    std::string set;
    double pressure = 0.0;  ///< kPa, inwards
    Curve curve{};
};

/// Pulls in one direction whatever becomes of the surface: a dead load.
struct Traction {
    std::string set;
    Eigen::Vector3d traction = Eigen::Vector3d::Zero();  ///< kPa, for each mm² at rest
    Curve curve{};
};

struct MembraneOn {
    std::string set;
    double shear_modulus = 0.0;  ///< kPa
    double thickness = 0.0;      ///< mm
};

/// The half space that tissue must not enter, or a ball, a closed surface, a label of the volume, or all that is none
/// of some labels of it (a skull around what it holds).
struct ObstacleLabel {
    int label = 0;
};
struct OutsideOfLabels {
    std::vector<int> labels;
};
using Body = std::variant<HalfSpace, Ball, meshing::SurfaceMesh, ObstacleLabel, OutsideOfLabels>;

struct Contact {
    std::string set;  ///< empty: the outer surface
    Body body;
    double gap = 0.0;  ///< mm, by which the body is smaller than stated
    double friction = 0.0;
    RigidMotion motion{};  ///< all of it where the curve is 1
    Curve curve{};
};

/// Two labels that slide on one another, or two sets of tissue, which may be of one label (a fissure, a cut). Nodes
/// that other tissue touches stay joined.
struct Sliding {
    enum class Opening { Held, Free };
    std::array<int, 2> labels{0, 0};
    double per_area = 100.0;  ///< kPa/mm, against overlap, and against opening where that is held
    std::string except;       ///< a set of nodes that stay joined
    Opening opening = Opening::Held;
    std::optional<std::array<std::string, 2>> sets{};  ///< in place of the labels
};
/// "labels 1 and 2", "the sets 'upper' and 'lower'".
std::string sides_of(const Sliding& sliding);

/// Tissue that is taken out at a time.
struct Resection {
    std::string set;
    double time = 0.0;  ///< s
};

enum class Device { Auto, Cpu, Gpu };

struct Solve {
    enum class Kind { Equilibrium, Dynamics };
    Kind kind = Kind::Equilibrium;
    double duration = 1.0;       ///< s
    int frames = 1;              ///< evenly spaced, the last one at the end; rest is a frame besides
    double tolerance_mm = 0.05;  ///< of an equilibrium
    tled::EquilibriumMethod method = tled::EquilibriumMethod::Automatic;
    tled::Scalar precision = tled::Scalar::Float32;  ///< of forces; Float64 on the CPU alone
    int load_steps = 1;                              ///< equal parts of its load to try first
    double damping = 2.0;                            ///< 1/s, of dynamics
    double step = 0.0;                               ///< s; 0: nine tenths of the critical one
    Device device = Device::Auto;
    int gpu_index = -1;
    std::optional<tled::Element> element;  ///< none: suggested_element()
};

struct Probe {
    std::string name;
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, at rest
};

struct Scene {
    std::string title;
    Geometry geometry;
    std::map<int, Tissue> tissues;
    double density = 1e-6;  ///< kg/mm³
    Regions sets;
    std::vector<Fixed> fixed;
    std::vector<Motion> motions;
    std::vector<Springs> springs;
    std::optional<Gravity> gravity;
    std::optional<FluidLevel> fluid;
    std::vector<Pressure> pressures;
    std::vector<Traction> tractions;
    std::vector<MembraneOn> membranes;
    std::vector<Contact> contacts;
    std::vector<Sliding> sliding;
    std::vector<Resection> resections;
    Solve solve;
    std::vector<Probe> probes;
};

/// Throws InvalidInput, naming what and where, for numbers without meaning, sets that do not exist, labels without a
/// tissue, and loads that contradict each other. Cheap: nothing is meshed.
void require_valid(const Scene& scene);

}  // namespace tissuewarp::simulation
