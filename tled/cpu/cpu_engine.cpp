// The step of total Lagrangian explicit dynamics on the CPU, in the order of Miller et al. (2007), table 1:
// element forces, gather by node, central-difference update. A patch of tetrahedra does all three for the nodes that it
// owns while they are in the cache; nodes that several patches or hexahedra move follow. All sums run in a fixed order.

#include "core/errors.hpp"
#include "tled/cpu/cpu_batches.hpp"
#include "tled/cpu/cpu_contact.hpp"
#include "tled/cpu/cpu_effects.hpp"
#include "tled/cpu/cpu_kernels.hpp"
#include "tled/cpu/cpu_pressures.hpp"
#include "tled/cpu/cpu_springs.hpp"
#include "tled/cpu/fan_layout.hpp"
#include "tled/engine.hpp"
#include "tled/material/prony_coefficients.hpp"
#include "tled/material/stress_clock.hpp"
#include "tled/parallel/parallel.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

namespace tissuewarp::tled {

namespace {

using detail::batch_width;
using detail::BatchBlock;
using detail::ElementBatches;
using detail::FanPatch;
using detail::Kinematics;
using detail::record;
using detail::Stresses;

void require_columns(Eigen::Index columns, std::size_t nodes, const char* what) {
    if (static_cast<std::size_t>(columns) != nodes)
        throw InvalidInput(std::string(what) + " has " + std::to_string(columns) + " columns; the model has " +
                           std::to_string(nodes) + " nodes");
}

std::vector<std::string> law_names(const RestState& rest) {
    std::vector<std::string> names;
    for (const Material& material : rest.materials) names.push_back(law_name(material));
    return names;
}

template <class T>
class CpuEngine final : public Engine {
public:
    explicit CpuEngine(const RestState& rest)
        : CpuEngine(rest, detail::fan_layout(rest, detail::suggested_patch_tets(rest.element_count()))) {}

    CpuEngine(const RestState& rest, const detail::FanLayout& fans)
        : layout_(fans.batches),
          elements_(detail::element_batches<T>(rest, fans)),
          hex_layout_(detail::batch_layout(rest.hexahedra.blocks)),
          hexahedra_(detail::hex_batches<T>(rest.hexahedra, hex_layout_, fans.internal)),
          materials_(detail::kernel_materials<T>(rest)),
          law_of_(law_names(rest)),
          kinematics_(rest.pressure.count() > 0 ? Kinematics::AveragedPressure : Kinematics::T4),
          node_count_(static_cast<std::size_t>(rest.node_count)),
          tet_(rest.tet),
          hex_(rest.hexahedra.hex),
          admits_inversion_(tled::admits_inversion(rest)),
          position_(rest.position),
          internal_(fans.internal),
          own_nodes_(fans.own_nodes),
          sources_(detail::force_sources(rest, fans, hex_layout_)),
          pressures_(rest.pressure, fans),
          stress_clock_(rest.viscosity) {
        const std::size_t vector_size = node_count_ * record;
        displacement_.assign(vector_size, T(0));
        increment_ = scratch_ = force_load_ = force_ = displacement_;
        inverse_mass_.assign(vector_size, T(0));
        contribution_.assign(first_hex_force() + hexahedra_.count() * 8 * batch_width * record, T(0));
        prepare_viscosity(rest);
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
        for (detail::ViscousBatches<T>& viscous : viscous_)
            std::fill(viscous.stress.begin(), viscous.stress.end(), T(0));
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

    void keep_state() override { kept_ = KeptState{displacement_, increment_, viscous_, stress_clock_}; }

    void return_to_kept_state() override {
        displacement_ = kept_->displacement;
        increment_ = kept_->increment;
        viscous_ = kept_->viscous;
        stress_clock_ = kept_->stress_clock;
        if (contact_) contact_->forget_looks();
    }

    void run(int steps, const StepCoefficients& coefficients) override {
        if (contact_) contact_->set_time_step(coefficients.time_step);
        for (const auto& [count, interval] : stress_clock_.next(steps, coefficients.time_step)) {
            set_stress_interval(interval);
            take_steps(count, coefficients, interval > 0 ? Stresses::Move : Stresses::Rest);
        }
    }

    [[nodiscard]] Eigen::Matrix3Xd displacement() const override { return to_matrix(displacement_); }
    [[nodiscard]] Eigen::Matrix3Xd increment() const override { return to_matrix(increment_); }

    [[nodiscard]] Eigen::Matrix3Xd residual() override { return residual_at(displacement_.data()); }

    [[nodiscard]] Eigen::Matrix3Xd internal_force() override {
        set_stress_interval(stress_clock_.lag());
        sum_forces(displacement_.data(), Stresses::Look, [](std::size_t, std::size_t) {});
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
        seen.min_jacobian_hex = smallest.hex;
        return seen;
    }

    [[nodiscard]] bool admits_inversion() const override { return admits_inversion_; }

    [[nodiscard]] SmallestJacobian smallest_jacobian() override {
        change_.resize(std::max(elements_.count(), hexahedra_.count()) * batch_width);
        SmallestJacobian smallest{std::numeric_limits<double>::infinity()};
        for_batches(0, elements_.count(), [&](std::size_t begin, std::size_t end) {
            detail::volume_changes(elements_, begin, end, displacement_.data(), change_.data());
        });
        note_smallest(layout_.slot, smallest, [&](std::size_t e) { return std::pair{tet_[e], -1}; });
        for_batches(0, hexahedra_.count(), [&](std::size_t begin, std::size_t end) {
            detail::hex_volume_changes(hexahedra_, begin, end, displacement_.data(), change_.data());
        });
        note_smallest(hex_layout_.slot, smallest, [&](std::size_t e) { return std::pair{-1, hex_[e]}; });
        return smallest;
    }

    [[nodiscard]] std::string description() const override {
        return std::string("CPU ") + (sizeof(T) == 4 ? "float32" : "float64") + ", " + detail::instruction_set() +
               ", " + std::to_string(tbb::this_task_arena::max_concurrency()) + " threads";
    }

    [[nodiscard]] std::vector<StepPass> step_passes() override {
        std::vector<StepPass> passes;
        const StepBuffer u = buffer("displacements", displacement_), f = buffer("nodal forces", force_);
        if (kinematics_ == Kinematics::AveragedPressure)
            passes.push_back({"patch_volume_changes", {}, {u}, elements_.count() * batch_width});
        if (surface_) passes.push_back({"CpuSurface::evaluate", surface_->parts(), {u}, surface_->nodes()});
        for (const BatchBlock& block : layout_.blocks) add_force_pass("patch_forces", block, 0, passes);
        for (const BatchBlock& block : hex_layout_.blocks)
            add_force_pass("hex_forces", block, viscosity_.size(), passes);
        StepPass advance{"advance_nodes", {}, {u, f, buffer("increments", increment_)}, node_count_};
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
    detail::BatchLayout layout_;
    ElementBatches<T> elements_;
    detail::BatchLayout hex_layout_;
    detail::HexBatches<T> hexahedra_;
    std::vector<detail::KernelMaterial<T>> materials_;
    std::vector<std::string> law_of_;  // each of them
    Kinematics kinematics_;
    std::size_t node_count_;
    std::vector<int> tet_, hex_;
    bool admits_inversion_;

    Eigen::Matrix3Xd position_;            // 3 × N, mm, at rest
    std::vector<std::uint32_t> internal_;  // node of the mesh → internal number
    std::size_t own_nodes_;                // internal numbers below belong to one patch
    detail::SourceLists sources_;          // of the other nodes: of `contribution_`
    std::vector<T> contribution_;          // records by patch × local node, then corner forces of hexahedra
    tbb::enumerable_thread_specific<detail::PatchScratch<T>> patch_scratch_;

    detail::CpuPressures<T> pressures_;
    detail::CpuSprings<T> springs_;
    std::optional<detail::CpuSurface<T>> surface_;  // absent where the scene has none, as the next two
    std::optional<detail::CpuFluid<T>> fluid_;
    std::optional<detail::CpuContact> contact_;

    // by material, for tetrahedra and then again for hexahedra; empty where none is viscous
    std::vector<PronySeries> viscosity_;
    std::vector<detail::ViscousBatches<T>> viscous_;
    detail::StressClock stress_clock_;

    struct KeptState {
        std::vector<T> displacement, increment;
        std::vector<detail::ViscousBatches<T>> viscous;
        detail::StressClock stress_clock;
    };
    std::optional<KeptState> kept_;

    std::vector<T> change_;  // J − 1 of elements in batches

    // records of four per internal node
    std::vector<T> displacement_, increment_, inverse_mass_, force_load_, free_, force_, scratch_;

    [[nodiscard]] std::size_t place(std::size_t node, std::size_t component) const {
        return internal_[node] * std::size_t{record} + component;
    }

    static StepBuffer buffer(const char* name, const std::vector<T>& values) {
        return {name, values.size() * sizeof(T)};
    }

    void add_force_pass(const char* function, const BatchBlock& block, std::size_t first_viscous,
                        std::vector<StepPass>& passes) const {
        const auto m = static_cast<std::size_t>(block.material);
        StepPass pass{function, {law_of_[m]}, {}, (block.end - block.begin) * batch_width};
        if (kinematics_ == Kinematics::AveragedPressure && first_viscous == 0)
            pass.parts.push_back("averaged pressure");
        pass.buffers.push_back(buffer("displacements", displacement_));
        pass.buffers.push_back(buffer("forces of shared nodes", contribution_));
        if (!viscosity_.empty() && !viscosity_[m].terms.empty()) {
            pass.parts.push_back("viscosity");
            pass.buffers.push_back({"viscous stresses", viscous_[first_viscous + m].stress.size() * sizeof(T)});
        }
        passes.push_back(pass);
    }

    template <class Body>
    static void for_batches(std::size_t begin, std::size_t end, const Body& body) {
        parallel_ranges(begin, end, 32, body);
    }

    /// body(patch, scratch) for all patches.
    template <class Body>
    void for_patches(const Body& body) {
        parallel_ranges(0, elements_.patches.size(), 1, [&](std::size_t begin, std::size_t end) {
            detail::PatchScratch<T>& scratch = patch_scratch_.local();
            for (std::size_t p = begin; p != end; ++p) body(elements_.patches[p], scratch);
        });
    }

    /// Internal forces at displacement `u` to `force_`; after(begin, end) as soon as those of nodes [begin, end) are
    /// there. It may move these nodes: no element that is still to come has one of them.
    template <class After>
    void sum_forces(T* u, Stresses stresses, const After& after) {
        if (kinematics_ == Kinematics::AveragedPressure) {
            for_patches([&](const FanPatch& patch, detail::PatchScratch<T>& scratch) {
                detail::patch_volume_changes(elements_, patch, u, scratch, pressures_.patch_changes());
            });
            pressures_.average(materials_);
        }
        for_patches([&](const FanPatch& patch, detail::PatchScratch<T>& scratch) {
            patch_forces(patch, u, stresses, scratch);
            after(patch.first_own, patch.first_own + patch.own_count);
        });
        hex_forces(u, stresses);
        parallel_ranges(own_nodes_, node_count_, 512, [&](std::size_t begin, std::size_t end) {
            for (std::size_t node = begin; node != end; ++node) sum_contributions(node);
            after(begin, end);
        });
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

    /// Internal forces less those of springs and effects, as sum_forces.
    template <class Surface, class Fluid, class After>
    void sum_all_forces(Surface surface, Fluid fluid, T* u, Stresses stresses, const After& after) {
        if constexpr (surface) surface_->evaluate(u);
        sum_forces(u, stresses, [&](std::size_t begin, std::size_t end) {
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

    void patch_forces(const FanPatch& patch, const T* u, Stresses stresses, detail::PatchScratch<T>& scratch) {
        const std::size_t m = patch.material;
        if (viscous_.empty() || viscous_[m].coefficient.empty())
            detail::patch_forces(materials_[m], kinematics_, elements_, patch, u, pressures_.pressure(), scratch,
                                 force_.data(), contribution_.data());
        else
            detail::viscous_patch_forces(materials_[m], viscous_[m], stresses, kinematics_, elements_, patch, u,
                                         pressures_.pressure(), scratch, force_.data(), contribution_.data());
    }

    void hex_forces(const T* u, Stresses stresses) {
        T* hex_force = contribution_.data() + first_hex_force();
        for (const BatchBlock& block : hex_layout_.blocks) {
            const auto m = static_cast<std::size_t>(block.material), v = viscosity_.size() + m;
            for_batches(block.begin, block.end, [&](std::size_t begin, std::size_t end) {
                if (viscous_.empty() || viscous_[v].coefficient.empty())
                    detail::hex_forces(materials_[m], hexahedra_, begin, end, u, hex_force);
                else
                    detail::viscous_hex_forces(materials_[m], viscous_[v], stresses, hexahedra_, begin, end, u,
                                               hex_force);
            });
        }
    }

    [[nodiscard]] std::size_t first_hex_force() const { return elements_.nodes.node.size() * record; }

    void sum_contributions(std::size_t node) {
        std::array<T, record> sum{};
        const std::size_t list = node - own_nodes_;
        for (std::uint32_t k = sources_.offset[list]; k < sources_.offset[list + 1]; ++k) {
            const T* f = &contribution_[std::size_t{sources_.entry[k]} * record];
            for (std::size_t c = 0; c < record; ++c) sum[c] += f[c];
        }
        std::copy(sum.begin(), sum.end(), &force_[node * record]);
    }

    void prepare_viscosity(const RestState& rest) {
        viscosity_ = rest.viscosity;
        viscous_.resize(2 * viscosity_.size());
        const auto prepare = [&](const std::vector<BatchBlock>& blocks, std::size_t first) {
            for (const BatchBlock& block : blocks) {
                const auto m = static_cast<std::size_t>(block.material);
                viscous_[first + m].first_batch = block.begin;
                viscous_[first + m].stress.assign(
                    (block.end - block.begin) * viscosity_[m].terms.size() * 6 * batch_width, T(0));
            }
        };
        if (!viscosity_.empty()) {
            prepare(layout_.blocks, 0);
            prepare(hex_layout_.blocks, viscosity_.size());
        }
        set_stress_interval(0);
    }

    void set_stress_interval(double interval) {
        for (std::size_t m = 0; m < viscous_.size(); ++m) {
            viscous_[m].coefficient.clear();
            for (const auto& [a, b] : detail::prony_coefficients(viscosity_[m % viscosity_.size()], interval))
                viscous_[m].coefficient.push_back({T(a), T(b)});
        }
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

    /// Takes the smallest of `change_` where it is below what is known; place(e) is its tetrahedron and hexahedron.
    template <class Place>
    void note_smallest(const std::vector<std::size_t>& slot, SmallestJacobian& smallest, const Place& place) const {
        for (std::size_t e = 0; e < slot.size(); ++e) {
            const double jacobian = 1 + double(change_[slot[e]]);
            if (jacobian >= smallest.value) continue;
            const auto [tet, hex] = place(e);
            const bool unknown = std::isnan(jacobian);
            smallest = {unknown ? -std::numeric_limits<double>::infinity() : jacobian, tet, hex};
            if (unknown) return;
        }
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
