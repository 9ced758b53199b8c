#pragma once
/// Where the time steps run. Both engines advance the same update
///     u⁺ = u + ρ (u − u⁻) + c M⁻¹ (f_ext + f_spring − f_int(u)),
/// which is the central-difference step with mass-proportional damping α for c = Δt²/(1 + αΔt/2) and
/// ρ = (1 − αΔt/2)/(1 + αΔt/2) (Miller et al. 2007, eq. 17), and a step of dynamic relaxation for free ρ, c and M.

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"
#include "tled/step_pass.hpp"

#include <Eigen/Core>

#include <memory>
#include <span>
#include <string>

namespace tissuewarp::tled {

struct StepCoefficients {
    double momentum = 0.0;  ///< ρ
    double gain = 0.0;      ///< c, s² for a mass in kg; dimensionless for a mass in mN/mm
    /// Δt, s, in which viscous stresses move on, by steps of their own (docs/decisions/viscous_steps.md); without it
    /// (0) they rest as they are. Not read where no material is viscous.
    double time_step = 0.0;
};

struct Steps {
    int count = 0;
    StepCoefficients coefficients;
};

/// Scalars of the present state, reduced where the engine runs. Sums are over free degrees of freedom.
struct Observation {
    double increment_max = 0;   ///< largest |u − u⁻| of a node, mm
    double residual_max = 0;    ///< largest |residual| of a node, mN
    double increment_mass = 0;  ///< Σ m (u − u⁻)²
    double increment_stiffness =
        0;  ///< Σ (u − u⁻)·(r⁻ − r): with increment_mass the Rayleigh quotient of the last step
    double min_jacobian = 1;    ///< smallest det F of an element
    int min_jacobian_tet = -1;  ///< its tetrahedron in the mesh
    bool finite = true;         ///< false when any displacement is not finite
};

/// Smallest det F of an element and its tetrahedron in the mesh; −∞ where none can be computed.
struct SmallestJacobian {
    double value = 1;
    int tet = -1;
};

/// A displacement (3 × N, mm) and the smallest det F of it.
struct CheckedDisplacement {
    Eigen::Matrix3Xd value;
    SmallestJacobian smallest;
};

enum class Processor { Cpu, Gpu };

/// State: displacement u and increment u − u⁻ (3 × N, mm), viscous stresses, nodal diagonal mass (3 × N), conditions.
/// Copies in and out are float64 whatever the engine computes in. Viscous stresses move on with some of the steps and
/// rest in the others; residual() and observe() take them as they rest, internal_force() brings them to the present
/// time.
class Engine {
public:
    virtual ~Engine() = default;

    /// Replaces all conditions. Imposed displacements take effect at once, with zero increment.
    virtual void set_conditions(const NodalConditions& conditions) = 0;
    /// Diagonal mass of every degree of freedom, positive: kg for dynamics, mN/mm for dynamic relaxation.
    virtual void set_mass(const Eigen::Matrix3Xd& mass) = 0;
    /// Forgets viscous stresses: the material answers as if it had been at rest until now.
    virtual void set_state(const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& increment) = 0;

    /// Replaces the increment u − u⁻ (3 × N, mm) alone.
    virtual void set_increment(const Eigen::Matrix3Xd& increment) = 0;
    /// Keeps displacement, increment and viscous stresses where they are computed, replacing what was kept before; and
    /// goes back to them. The first state kept is the one at construction.
    virtual void keep_state() = 0;
    virtual void return_to_kept_state() = 0;

    /// Advances by `steps` without any transfer between host and device.
    virtual void run(int steps, const StepCoefficients& coefficients) = 0;

    [[nodiscard]] virtual Eigen::Matrix3Xd displacement() const = 0;
    [[nodiscard]] virtual Eigen::Matrix3Xd increment() const = 0;
    /// f_ext + f_spring − f_int at the present displacement, mN; zero at constrained degrees of freedom.
    [[nodiscard]] virtual Eigen::Matrix3Xd residual() = 0;
    /// f_int at the present displacement, mN, constrained degrees of freedom included (reactions).
    [[nodiscard]] virtual Eigen::Matrix3Xd internal_force() = 0;
    [[nodiscard]] virtual Observation observe() = 0;
    /// At the present displacement; a quarter of a force evaluation.
    [[nodiscard]] virtual SmallestJacobian smallest_jacobian() = 0;
    /// run() of each, then displacement() and smallest_jacobian(): a GPU is waited for once.
    [[nodiscard]] virtual CheckedDisplacement run_and_check(std::span<const Steps> steps) = 0;
    /// Whether every material's energy is finite for det F ≤ 0, so that inverted tissue finds back.
    [[nodiscard]] virtual bool admits_inversion() const = 0;

    /// The passes of a step under the present conditions, in order.
    [[nodiscard]] virtual std::vector<StepPass> step_passes() = 0;

    /// For reports: "CPU float32, AVX-512, 2 threads", "GPU NVIDIA H100 (OpenGL 4.5)".
    [[nodiscard]] virtual std::string description() const = 0;
    [[nodiscard]] virtual Processor processor() const = 0;
    /// Unit round-off of the arithmetic that the engine computes in.
    [[nodiscard]] virtual double precision() const = 0;
};

enum class Scalar { Float32, Float64 };

/// SIMD over elements (Highway, widest set of the machine), threads by TBB. Same bits for any number of threads.
std::unique_ptr<Engine> make_cpu_engine(const RestState& rest, Scalar scalar = Scalar::Float32);

/// How a GPU takes its steps. Patches take one dispatch for a step (two with averaged pressure) where they know the
/// scene: tetrahedra of one law, with fibres and viscosity where it has them. Anything else, and every scene with
/// `patch_tets` 0, takes a pass over elements and one over nodes.
struct GpuStepShape {
    int patch_tets = 0;   ///< tetrahedra of a patch; fewer where its nodes do not fit into shared memory
    int longest_fan = 5;  ///< tetrahedra that one invocation computes in turn, 1 … 5
    int workgroup = 128;  ///< invocations for a patch
    /// Workgroups that run at the same time, share out the patches and take many steps in a dispatch; 0: a workgroup
    /// for each patch and one step in a dispatch. Where the device does not run so many, the engine finds out within a
    /// fraction of a second and goes on as with 0.
    int at_once = 0;
    friend bool operator==(const GpuStepShape&, const GpuStepShape&) = default;
};

/// What measured best on an H100 for a mesh of so many tetrahedra (docs/lab/performance.md), carried over to a device
/// of so many multiprocessors; where these are unknown (0), to one of as many as an H100 has.
GpuStepShape suggested_gpu_step_shape(int element_count, Element element = Element::T4, int multiprocessors = 0);

/// "two passes", "2910:5:640" (tetrahedra, fan, workgroup) or "2910:5:640:132" (workgroups at once).
std::string name_of(const GpuStepShape& shape);

/// OpenGL 4.5 compute through EGL, float32. `device` counts EGL devices; −1 takes the first hardware device, or the
/// software rasteriser when there is none. Without a shape, hardware takes the suggested one and a
/// software rasteriser two passes. Its forces on this mesh are compared with the scalar reference once. Throws
/// GpuUnavailable, also when they differ.
std::unique_ptr<Engine> make_gpu_engine(const RestState& rest, int device = -1);
std::unique_ptr<Engine> make_gpu_engine(const RestState& rest, int device, const GpuStepShape& shape);

}  // namespace tissuewarp::tled
