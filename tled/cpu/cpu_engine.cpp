// The step of total Lagrangian explicit dynamics on the CPU, in the order of Miller et al. (2007), table 1:
// element forces, gather by node, central-difference update. A patch of tetrahedra does all three for the nodes that it
// owns while they are in the cache; nodes that several patches move follow. All sums run in a fixed order.

#include "core/errors.hpp"
#include "tled/cpu/cpu_contact.hpp"
#include "tled/cpu/cpu_effects.hpp"
#include "tled/cpu/cpu_forces.hpp"
#include "tled/cpu/cpu_kernels.hpp"
#include "tled/cpu/cpu_springs.hpp"
#include "tled/cpu/fan_layout.hpp"
#include "tled/engine.hpp"
#include "tled/material/stress_clock.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

namespace tissuewarp::tled {

namespace {

using detail::record;
using detail::step_buffer;
using detail::Stresses;

void require_columns(Eigen::Index columns, std::size_t nodes, const char* what) {
    if (static_cast<std::size_t>(columns) != nodes)
        throw InvalidInput(std::string(what) + " has " + std::to_string(columns) + " columns; the model has " +
                           std::to_string(nodes) + " nodes");
}

template <class T>
class CpuEngine final : public Engine {
public:
    explicit CpuEngine(const RestState& rest)
        : CpuEngine(rest, detail::fan_layout(rest, detail::suggested_patch_tets(rest.element_count()))) {}

    CpuEngine(const RestState& rest, const detail::FanLayout& fans)
        : forces_(rest, fans),
          node_count_(static_cast<std::size_t>(rest.node_count)),
          admits_inversion_(tled::admits_inversion(rest)),
          position_(rest.position),
          internal_(fans.internal),
          stress_clock_(rest.viscosity) {
        const std::size_t vector_size = node_count_ * record;
        displacement_.assign(vector_size, T(0));
        increment_ = scratch_ = force_load_ = force_ = displacement_;
        inverse_mass_.assign(vector_size, T(0));
        free_.assign(vector_size, T(1));
        for (std::size_t node = 0; node < node_count_; ++node) free_[node * record + 3] = T(0);
        Eigen::Matrix3Xd mass(3, rest.node_count);
        for (int c = 0; c < 3; ++c) mass.row(c) = rest.lumped_mass.transpose();
        set_mass(mass);
        keep_state();
    }

    void set_conditions(const NodalConditions& conditions) override {
        require_columns(conditions.constrained.cols(), node_count_, "the set of conditions");
        springs_ = detail::CpuSprings<T>(conditions, internal_);
        set_effects(conditions.effects);
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const auto row = static_cast<Eigen::Index>(c), column = static_cast<Eigen::Index>(node);
                const std::size_t at = place(node, c);
                force_load_[at] = T(conditions.external_force(row, column));
                free_[at] = conditions.constrained(row, column) ? T(0) : T(1);
                if (free_[at] != T(0)) continue;
                displacement_[at] = T(conditions.imposed(row, column));
                increment_[at] = T(0);
            }
    }

    void set_mass(const Eigen::Matrix3Xd& mass) override {
        require_columns(mass.cols(), node_count_, "the mass");
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const double m = mass(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node));
                if (!(m > 0) || !std::isfinite(m))
                    throw InvalidInput("the mass of node " + std::to_string(node) + " is " + std::to_string(m) +
                                       "; it must be positive");
                inverse_mass_[place(node, c)] = T(1 / m);
            }
    }

    void set_state(const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& increment) override {
        require_columns(displacement.cols(), node_count_, "the displacement");
        require_columns(increment.cols(), node_count_, "the increment");
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const std::size_t at = place(node, c);
                if (free_[at] == T(0)) continue;
                displacement_[at] = T(displacement(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)));
                increment_[at] = T(increment(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)));
            }
        if (contact_) contact_->forget_looks();
        forces_.forget_stresses();
        stress_clock_.forget();
    }

    void set_increment(const Eigen::Matrix3Xd& increment) override {
        require_columns(increment.cols(), node_count_, "the increment");
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const std::size_t at = place(node, c);
                increment_[at] =
                    free_[at] * T(increment(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)));
            }
    }

    void keep_state() override { kept_ = KeptState{displacement_, increment_, forces_.stresses(), stress_clock_}; }

    void return_to_kept_state() override {
        displacement_ = kept_->displacement;
        increment_ = kept_->increment;
        forces_.return_to(kept_->viscous);
        stress_clock_ = kept_->stress_clock;
        if (contact_) contact_->forget_looks();
    }

    void run(int steps, const StepCoefficients& coefficients) override {
        if (contact_) contact_->set_time_step(coefficients.time_step);
        for (const auto& [count, interval] : stress_clock_.next(steps, coefficients.time_step)) {
            forces_.set_stress_interval(interval);
            take_steps(count, coefficients, interval > 0 ? Stresses::Move : Stresses::Rest);
        }
    }

    [[nodiscard]] Eigen::Matrix3Xd displacement() const override { return to_matrix(displacement_); }
    [[nodiscard]] Eigen::Matrix3Xd increment() const override { return to_matrix(increment_); }

    [[nodiscard]] Eigen::Matrix3Xd residual() override { return residual_at(displacement_.data()); }

    [[nodiscard]] Eigen::Matrix3Xd internal_force() override {
        forces_.set_stress_interval(stress_clock_.lag());
        forces_.sum(displacement_.data(), Stresses::Look, force_, [](std::size_t, std::size_t) {});
        return to_matrix(force_);
    }

    [[nodiscard]] Observation observe() override {
        const Eigen::Matrix3Xd step = increment();
        const bool still = step.isZero(0.0);
        const Eigen::Matrix3Xd earlier = still ? Eigen::Matrix3Xd() : residual_before();
        const Eigen::Matrix3Xd now = residual();
        const Eigen::Matrix3Xd& before = still ? now : earlier;

        Observation seen;
        constexpr double infinite = std::numeric_limits<double>::infinity();
        const bool finite_motion = displacement().allFinite() && step.allFinite();
        seen.finite = finite_motion && now.allFinite();
        seen.increment_max = finite_motion ? std::sqrt(step.colwise().squaredNorm().maxCoeff()) : infinite;
        seen.residual_max = seen.finite ? std::sqrt(now.colwise().squaredNorm().maxCoeff()) : infinite;
        for (Eigen::Index node = 0; node < step.cols(); ++node)
            for (Eigen::Index c = 0; c < 3; ++c) {
                const double v = step(c, node);
                const std::size_t at = place(static_cast<std::size_t>(node), static_cast<std::size_t>(c));
                seen.increment_mass += v * v / double(inverse_mass_[at]);
                seen.increment_stiffness += v * (before(c, node) - now(c, node));
            }
        const SmallestJacobian smallest = smallest_jacobian();
        seen.min_jacobian = smallest.value;
        seen.min_jacobian_tet = smallest.tet;
        return seen;
    }

    [[nodiscard]] bool admits_inversion() const override { return admits_inversion_; }

    [[nodiscard]] SmallestJacobian smallest_jacobian() override {
        return forces_.smallest_jacobian(displacement_.data());
    }
    [[nodiscard]] CheckedDisplacement run_and_check(std::span<const Steps> steps) override {
        for (const Steps& each : steps) run(each.count, each.coefficients);
        return {displacement(), smallest_jacobian()};
    }

    [[nodiscard]] std::string description() const override {
        return std::string("CPU ") + (sizeof(T) == 4 ? "float32" : "float64") + ", " + detail::instruction_set() +
               ", " + std::to_string(tbb::this_task_arena::max_concurrency()) + " threads";
    }

    [[nodiscard]] std::vector<StepPass> step_passes() override {
        std::vector<StepPass> passes;
        const StepBuffer u = step_buffer("displacements", displacement_), f = step_buffer("nodal forces", force_);
        forces_.add_volume_pass(u, passes);
        if (surface_) passes.push_back({"CpuSurface::evaluate", surface_->parts(), {u}, surface_->nodes()});
        forces_.add_force_passes(u, passes);
        StepPass advance{"advance_nodes", {}, {u, f, step_buffer("increments", increment_)}, node_count_};
        if (!springs_.empty()) advance.parts.push_back("springs");
        if (surface_) advance.parts.push_back("surface");
        if (fluid_) advance.parts.push_back("fluid");
        if (contact_) advance.parts.push_back("contact");
        if (contact_ && contact_->turning()) advance.parts.push_back("turning");
        passes.push_back(advance);
        return passes;
    }

    [[nodiscard]] Processor processor() const override { return Processor::Cpu; }
    [[nodiscard]] double precision() const override { return double(std::numeric_limits<T>::epsilon()); }

private:
    detail::CpuForces<T> forces_;
    std::size_t node_count_;
    bool admits_inversion_;

    Eigen::Matrix3Xd position_;            // 3 × N, mm, at rest
    std::vector<std::uint32_t> internal_;  // node of the mesh → internal number

    detail::CpuSprings<T> springs_;
    std::optional<detail::CpuSurface<T>> surface_;  // absent where the scene has none, as the next two
    std::optional<detail::CpuFluid<T>> fluid_;
    std::optional<detail::CpuContact> contact_;

    detail::StressClock stress_clock_;

    struct KeptState {
        std::vector<T> displacement, increment;
        std::vector<detail::ViscousBatches<T>> viscous;
        detail::StressClock stress_clock;
    };
    std::optional<KeptState> kept_;

    // records of four per internal node
    std::vector<T> displacement_, increment_, inverse_mass_, force_load_, free_, force_, scratch_;

    [[nodiscard]] std::size_t place(std::size_t node, std::size_t component) const {
        return internal_[node] * std::size_t{record} + component;
    }

    /// body(surface, fluid, contact, turning), each std::true_type where the scene has it and std::false_type
    /// otherwise: the step of a scene is compiled for the effects that it has.
    template <class Body>
    void with_effects(const Body& body) {
        const auto choose = [](bool present, const auto& next) {
            if (present)
                next(std::true_type{});
            else
                next(std::false_type{});
        };
        choose(surface_.has_value(), [&](auto surface) {
            choose(fluid_.has_value(), [&](auto fluid) {
                choose(contact_.has_value(), [&](auto contact) {
                    if constexpr (contact)
                        choose(contact_->turning(), [&](auto turning) { body(surface, fluid, contact, turning); });
                    else
                        body(surface, fluid, contact, std::false_type{});
                });
            });
        });
    }

    void take_steps(int steps, const StepCoefficients& coefficients, Stresses stresses) {
        const T momentum = T(coefficients.momentum), gain = T(coefficients.gain);
        T* u = displacement_.data();
        with_effects([&](auto surface, auto fluid, auto contact, auto turning) {
            for (int step = 0; step < steps; ++step)
                sum_all_forces(surface, fluid, u, stresses, [&](std::size_t begin, std::size_t end) {
                    const std::size_t at = begin * record;
                    detail::advance_nodes(momentum, gain, &inverse_mass_[at], &force_load_[at], &force_[at], &free_[at],
                                          &increment_[at], u + at, end - begin);
                    if constexpr (contact) contact_->settle(turning, begin, end, free_.data(), increment_.data(), u);
                });
        });
    }

    /// Internal forces less those of springs and effects, as CpuForces::sum.
    template <class Surface, class Fluid, class After>
    void sum_all_forces(Surface surface, Fluid fluid, T* u, Stresses stresses, const After& after) {
        if constexpr (surface) surface_->evaluate(u);
        forces_.sum(u, stresses, force_, [&](std::size_t begin, std::size_t end) {
            springs_.take_off(u, begin, end, force_.data());
            if constexpr (surface) surface_->take_off(begin, end, force_.data());
            if constexpr (fluid) fluid_->take_off(u, begin, end, force_.data());
            after(begin, end);
        });
    }

    void set_effects(const NodalEffects& effects) {
        surface_.reset();
        fluid_.reset();
        if (!effects.surface.empty()) surface_.emplace(effects.surface, position_, internal_);
        if (effects.fluid) fluid_.emplace(*effects.fluid, internal_);
        if (!effects.contact)
            contact_.reset();
        else if (!contact_ || !contact_->take(*effects.contact))
            contact_.emplace(*effects.contact, internal_);
    }

    /// f_ext + f_spring − f_int, masked by the constraints.
    [[nodiscard]] Eigen::Matrix3Xd residual_at(T* u) {
        with_effects([&](auto surface, auto fluid, auto, auto) {
            sum_all_forces(surface, fluid, u, Stresses::Rest, [&](std::size_t begin, std::size_t end) {
                for (std::size_t at = begin * record; at < end * record; ++at)
                    force_[at] = free_[at] * (force_load_[at] - force_[at]);
            });
        });
        return to_matrix(force_);
    }

    /// At u − (u − u⁻).
    [[nodiscard]] Eigen::Matrix3Xd residual_before() {
        for (std::size_t i = 0; i < scratch_.size(); ++i) scratch_[i] = displacement_[i] - increment_[i];
        return residual_at(scratch_.data());
    }

    [[nodiscard]] Eigen::Matrix3Xd to_matrix(const std::vector<T>& records) const {
        Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(node_count_));
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c)
                matrix(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)) = double(records[place(node, c)]);
        return matrix;
    }
};

}  // namespace

std::unique_ptr<Engine> make_cpu_engine(const RestState& rest, Scalar scalar) {
    if (scalar == Scalar::Float32) return std::make_unique<CpuEngine<float>>(rest);
    return std::make_unique<CpuEngine<double>>(rest);
}

}  // namespace tissuewarp::tled
