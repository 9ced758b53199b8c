// The step of total Lagrangian explicit dynamics on the CPU, in the order of Miller et al. (2007), table 1:
// element forces, gather by node, central-difference update. All sums run in a fixed order.

#include "core/errors.hpp"
#include "tled/detail/cpu_batches.hpp"
#include "tled/detail/cpu_kernels.hpp"
#include "tled/detail/kernel_parameters.hpp"
#include "tled/detail/parallel.hpp"
#include "tled/detail/prony_coefficients.hpp"
#include "tled/engine.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::tled {

namespace {

using detail::Advance;
using detail::batch_width;
using detail::BatchBlock;
using detail::ElementBatches;
using detail::Kinematics;
using detail::record;

template <class T>
std::vector<detail::KernelMaterial<T>> kernel_materials(const RestState& rest) {
    std::vector<detail::KernelMaterial<T>> result;
    for (const Material& material : rest.materials) {
        detail::KernelMaterial<T> entry{material.index(), {}};
        const detail::KernelParameters parameters = detail::kernel_parameters(material);
        std::transform(parameters.begin(), parameters.end(), entry.parameter.begin(), [](double p) { return T(p); });
        result.push_back(entry);
    }
    return result;
}

void require_columns(Eigen::Index columns, std::size_t nodes, const char* what) {
    if (static_cast<std::size_t>(columns) != nodes)
        throw InvalidInput(std::string(what) + " has " + std::to_string(columns) + " columns; the model has " +
                           std::to_string(nodes) + " nodes");
}

template <class T>
class CpuEngine final : public Engine {
public:
    explicit CpuEngine(const RestState& rest)
        : layout_(detail::batch_layout(rest.blocks)),
          elements_(detail::element_batches<T>(rest, layout_)),
          hex_layout_(detail::batch_layout(rest.hexahedra.blocks)),
          hexahedra_(detail::hex_batches<T>(rest.hexahedra, hex_layout_)),
          materials_(kernel_materials<T>(rest)),
          kinematics_(rest.pressure.count() > 0 ? Kinematics::AveragedPressure : Kinematics::T4),
          node_count_(static_cast<std::size_t>(rest.node_count)),
          tet_(rest.tet),
          hex_(rest.hexahedra.hex),
          admits_inversion_(tled::admits_inversion(rest)),
          forces_(detail::force_lists(rest, layout_, hex_layout_)) {
        const std::size_t vector_size = node_count_ * record;
        displacement_.assign(vector_size, T(0));
        increment_ = scratch_ = force_load_ = displacement_;
        inverse_mass_.assign(vector_size, T(0));
        spring_of_node_.assign(node_count_, -1);
        corner_force_.assign(first_hex_force() + hexahedra_.count() * 8 * batch_width * record, T(0));
        if (kinematics_ == Kinematics::AveragedPressure) prepare_pressure(rest.pressure);
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
        spring_of_node_.assign(node_count_, -1);
        springs_.clear();
        for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
            spring_of_node_[static_cast<std::size_t>(conditions.spring_node[s])] = static_cast<std::int32_t>(s);
            const auto column = static_cast<Eigen::Index>(s);
            std::array<T, 9> spring;
            for (int k = 0; k < 6; ++k) spring[static_cast<std::size_t>(k)] = T(conditions.spring_stiffness(k, column));
            for (int k = 0; k < 3; ++k) spring[static_cast<std::size_t>(6 + k)] = T(conditions.spring_force(k, column));
            springs_.push_back(spring);
        }
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const auto row = static_cast<Eigen::Index>(c), column = static_cast<Eigen::Index>(node);
                const std::size_t at = node * record + c;
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
                inverse_mass_[node * record + c] = T(1 / m);
            }
    }

    void set_state(const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& increment) override {
        require_columns(displacement.cols(), node_count_, "the displacement");
        require_columns(increment.cols(), node_count_, "the increment");
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const std::size_t at = node * record + c;
                if (free_[at] == T(0)) continue;
                displacement_[at] = T(displacement(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)));
                increment_[at] = T(increment(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)));
            }
        for (detail::ViscousBatches<T>& viscous : viscous_)
            std::fill(viscous.stress.begin(), viscous.stress.end(), T(0));
    }

    void set_increment(const Eigen::Matrix3Xd& increment) override {
        require_columns(increment.cols(), node_count_, "the increment");
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c) {
                const std::size_t at = node * record + c;
                increment_[at] =
                    free_[at] * T(increment(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)));
            }
    }

    void keep_state() override { kept_ = {displacement_, increment_, viscous_}; }

    void return_to_kept_state() override {
        displacement_ = kept_.displacement;
        increment_ = kept_.increment;
        viscous_ = kept_.viscous;
    }

    void run(int steps, const StepCoefficients& coefficients) override {
        const T momentum = T(coefficients.momentum), gain = T(coefficients.gain);
        set_time_step(coefficients.time_step);
        for (int step = 0; step < steps; ++step) {
            corner_forces(displacement_.data(), Advance::Yes);
            for_nodes([&](std::size_t node) {
                T residual[3];
                node_residual(node, displacement_.data(), residual);
                for (std::size_t c = 0; c < 3; ++c) {
                    const std::size_t at = node * record + c;
                    // Selected, not multiplied by zero: a blown-up state would leave NaN on constrained nodes for good.
                    increment_[at] =
                        free_[at] != T(0) ? momentum * increment_[at] + gain * inverse_mass_[at] * residual[c] : T(0);
                    displacement_[at] += increment_[at];
                }
            });
        }
    }

    [[nodiscard]] Eigen::Matrix3Xd displacement() const override { return to_matrix(displacement_); }
    [[nodiscard]] Eigen::Matrix3Xd increment() const override { return to_matrix(increment_); }

    [[nodiscard]] Eigen::Matrix3Xd residual() override {
        corner_forces(displacement_.data());
        return residual_at(displacement_.data());
    }

    [[nodiscard]] Eigen::Matrix3Xd internal_force() override {
        corner_forces(displacement_.data());
        Eigen::Matrix3Xd force(3, static_cast<Eigen::Index>(node_count_));
        for_nodes([&](std::size_t node) {
            T sum[3];
            gathered_force(node, sum);
            for (Eigen::Index c = 0; c < 3; ++c) force(c, static_cast<Eigen::Index>(node)) = double(sum[c]);
        });
        return force;
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
                const std::size_t at = static_cast<std::size_t>(node) * record + static_cast<std::size_t>(c);
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

    [[nodiscard]] Processor processor() const override { return Processor::Cpu; }
    [[nodiscard]] double precision() const override { return double(std::numeric_limits<T>::epsilon()); }

private:
    detail::BatchLayout layout_;
    ElementBatches<T> elements_;
    detail::BatchLayout hex_layout_;
    detail::HexBatches<T> hexahedra_;
    std::vector<detail::KernelMaterial<T>> materials_;
    Kinematics kinematics_;
    std::size_t node_count_;
    std::vector<int> tet_, hex_;
    bool admits_inversion_;

    detail::ForceLists forces_;
    std::vector<T> corner_force_;  // of tetrahedra, then of hexahedra

    // averaged pressure
    std::vector<int> pressure_offset_;
    std::vector<std::uint32_t> pressure_entry_;
    std::vector<T> inverse_pressure_volume_, pressure_modulus_, nodal_change_, nodal_pressure_, change_;
    std::vector<BatchBlock> pressure_runs_;  // runs of pressure nodes that share a material

    // by material, for tetrahedra and then again for hexahedra; empty where none is viscous
    std::vector<PronySeries> viscosity_;
    std::vector<detail::ViscousBatches<T>> viscous_;

    struct KeptState {
        std::vector<T> displacement, increment;
        std::vector<detail::ViscousBatches<T>> viscous;
    };
    KeptState kept_;

    // records of four per node
    std::vector<T> displacement_, increment_, inverse_mass_, force_load_, free_, scratch_;
    std::vector<std::int32_t> spring_of_node_;
    std::vector<std::array<T, 9>> springs_;  // xx yy zz xy yz zx, K·target

    void prepare_pressure(const PressureNodes& pressure) {
        const auto count = static_cast<std::size_t>(pressure.count());
        pressure_offset_ = pressure.incidence.offset;
        pressure_entry_ = detail::pressure_slots(pressure, layout_);
        inverse_pressure_volume_.resize(count);
        pressure_modulus_.resize(count);
        nodal_change_.assign(count, T(0));
        nodal_pressure_.assign(count, T(0));
        change_.assign(elements_.count() * batch_width, T(0));
        for (std::size_t a = 0; a < count; ++a) {
            inverse_pressure_volume_[a] = T(1 / pressure.volume[static_cast<Eigen::Index>(a)]);
            pressure_modulus_[a] = T(pressure.modulus[static_cast<Eigen::Index>(a)]);
            if (pressure_runs_.empty() || pressure_runs_.back().material != pressure.material[a])
                pressure_runs_.push_back({pressure.material[a], a, a});
            pressure_runs_.back().end = a + 1;
        }
    }

    template <class Body>
    void for_nodes(const Body& body) const {
        parallel_ranges(0, node_count_, 1024, [&](std::size_t begin, std::size_t end) {
            for (std::size_t node = begin; node != end; ++node) body(node);
        });
    }

    template <class Body>
    static void for_batches(std::size_t begin, std::size_t end, const Body& body) {
        parallel_ranges(begin, end, 32, body);
    }

    /// Element pass: corner forces at displacement `u`, nodal pressures first where the element needs them.
    void corner_forces(const T* u, Advance advance = Advance::No) {
        if (kinematics_ == Kinematics::AveragedPressure) average_pressure(u);
        for (const BatchBlock& block : layout_.blocks) {
            const auto m = static_cast<std::size_t>(block.material);
            for_batches(block.begin, block.end, [&](std::size_t begin, std::size_t end) {
                if (viscous_.empty() || viscous_[m].coefficient.empty())
                    detail::element_forces(materials_[m], kinematics_, elements_, begin, end, u, nodal_pressure_.data(),
                                           corner_force_.data());
                else
                    detail::viscous_element_forces(materials_[m], viscous_[m], advance, kinematics_, elements_, begin,
                                                   end, u, nodal_pressure_.data(), corner_force_.data());
            });
        }
        T* hex_force = corner_force_.data() + first_hex_force();
        for (const BatchBlock& block : hex_layout_.blocks) {
            const auto m = static_cast<std::size_t>(block.material), v = viscosity_.size() + m;
            for_batches(block.begin, block.end, [&](std::size_t begin, std::size_t end) {
                if (viscous_.empty() || viscous_[v].coefficient.empty())
                    detail::hex_forces(materials_[m], hexahedra_, begin, end, u, hex_force);
                else
                    detail::viscous_hex_forces(materials_[m], viscous_[v], advance, hexahedra_, begin, end, u,
                                               hex_force);
            });
        }
    }

    [[nodiscard]] std::size_t first_hex_force() const { return elements_.count() * 4 * batch_width * record; }

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
        set_time_step(0);
    }

    void set_time_step(double time_step) {
        for (std::size_t m = 0; m < viscous_.size(); ++m) {
            viscous_[m].coefficient.clear();
            for (const auto& [a, b] : detail::prony_coefficients(viscosity_[m % viscosity_.size()], time_step))
                viscous_[m].coefficient.push_back({T(a), T(b)});
        }
    }

    /// q_a = M_a U'(J_a) with J_a − 1 = Σ ¼ V_e (J_e − 1) / V_a.
    void average_pressure(const T* u) {
        for_batches(0, elements_.count(), [&](std::size_t begin, std::size_t end) {
            detail::volume_changes(elements_, begin, end, u, change_.data());
        });
        parallel_ranges(0, nodal_change_.size(), 1024, [&](std::size_t begin, std::size_t end) {
            for (std::size_t a = begin; a != end; ++a) {
                T sum = 0;
                for (int k = pressure_offset_[a]; k < pressure_offset_[a + 1]; ++k) {
                    const std::uint32_t slot = pressure_entry_[static_cast<std::size_t>(k)];
                    sum += elements_.volume[slot] * change_[slot];
                }
                nodal_change_[a] = T(0.25) * sum * inverse_pressure_volume_[a];
            }
        });
        for (const BatchBlock& run : pressure_runs_)
            detail::nodal_pressures(materials_[static_cast<std::size_t>(run.material)].law,
                                    &pressure_modulus_[run.begin], &nodal_change_[run.begin],
                                    &nodal_pressure_[run.begin], run.end - run.begin);
    }

    void gathered_force(std::size_t node, T (&sum)[3]) const {
        sum[0] = sum[1] = sum[2] = 0;
        for (int k = forces_.offset[node]; k < forces_.offset[node + 1]; ++k) {
            const T* f = &corner_force_[static_cast<std::size_t>(forces_.entry[static_cast<std::size_t>(k)]) * record];
            for (int c = 0; c < 3; ++c) sum[c] += f[c];
        }
    }

    /// f_ext + f_spring − f_int, masked by the constraints.
    void node_residual(std::size_t node, const T* u, T (&residual)[3]) const {
        T internal[3];
        gathered_force(node, internal);
        const std::size_t at = node * record;
        for (std::size_t c = 0; c < 3; ++c) residual[c] = force_load_[at + c] - internal[c];
        if (spring_of_node_[node] >= 0) {
            const std::array<T, 9>& k = springs_[static_cast<std::size_t>(spring_of_node_[node])];
            const T x = u[at], y = u[at + 1], z = u[at + 2];
            residual[0] += k[6] - (k[0] * x + k[3] * y + k[5] * z);
            residual[1] += k[7] - (k[3] * x + k[1] * y + k[4] * z);
            residual[2] += k[8] - (k[5] * x + k[4] * y + k[2] * z);
        }
        for (std::size_t c = 0; c < 3; ++c) residual[c] *= free_[at + c];
    }

    [[nodiscard]] Eigen::Matrix3Xd residual_at(const T* u) const {
        Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(node_count_));
        for_nodes([&](std::size_t node) {
            T residual[3];
            node_residual(node, u, residual);
            for (Eigen::Index c = 0; c < 3; ++c) result(c, static_cast<Eigen::Index>(node)) = double(residual[c]);
        });
        return result;
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
        corner_forces(scratch_.data());
        return residual_at(scratch_.data());
    }

    [[nodiscard]] Eigen::Matrix3Xd to_matrix(const std::vector<T>& records) const {
        Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(node_count_));
        for (std::size_t node = 0; node < node_count_; ++node)
            for (std::size_t c = 0; c < 3; ++c)
                matrix(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(node)) =
                    double(records[node * record + c]);
        return matrix;
    }
};

}  // namespace

std::unique_ptr<Engine> make_cpu_engine(const RestState& rest, Scalar scalar) {
    if (scalar == Scalar::Float32) return std::make_unique<CpuEngine<float>>(rest);
    return std::make_unique<CpuEngine<double>>(rest);
}

}  // namespace tissuewarp::tled
