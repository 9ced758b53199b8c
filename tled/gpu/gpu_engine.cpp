// The step of total Lagrangian explicit dynamics on a GPU in two passes (Taylor, Cheng, Ourselin 2008): elements leave
// the forces of their corners, nodes gather them in a fixed order and advance. Nothing crosses to the host between
// steps.

#include "core/errors.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/readback.hpp"
#include "tled/engine.hpp"
#include "tled/gpu/gpu_effects.hpp"
#include "tled/gpu/gpu_force.hpp"
#include "tled/gpu/gpu_observation.hpp"
#include "tled/gpu/gpu_patches.hpp"
#include "tled/gpu/right_forces.hpp"
#include "tled/material/stress_clock.hpp"

#include <array>
#include <cmath>
#include <limits>

namespace tissuewarp::tled {
namespace {

using detail::BlockBuffers;
using detail::Float4;
using Eigen::Matrix3Xd;
using shaders::Buffer;
using shaders::CurrentContext;
using shaders::MaskConstrained;
using shaders::NodeEffects;
using shaders::Program;
using shaders::StoreResidual;
using Mask = Eigen::Matrix<bool, 3, Eigen::Dynamic>;

/// Recorded steps are handed over in portions of this many, so that the device starts while the host still records.
constexpr int steps_per_flush = 64;

void require_shape(const Matrix3Xd& matrix, int node_count, const char* what) {
    if (matrix.cols() != node_count)
        throw InvalidInput(std::string(what) + " has " + std::to_string(matrix.cols()) + " columns; the model has " +
                           std::to_string(node_count) + " nodes");
}

class GpuEngine final : public Engine {
public:
    GpuEngine(const RestState& rest, int device, const GpuStepShape& shape)
        : device_(device),
          programs_((detail::require_limits(device_), device_)),
          node_count_(rest.node_count),
          admits_inversion_(tled::admits_inversion(rest)),
          force_(device_, programs_, rest, blocks_),
          effects_(device_, programs_, rest),
          observation_(device_, programs_, rest),
          stress_clock_(rest.viscosity),
          kept_stress_clock_(rest.viscosity),
          displacement_(node_vectors("displacements")),
          increment_(node_vectors("increments")),
          inverse_mass_(node_vectors("inverse masses")),
          residual_(node_vectors("residuals")),
          previous_residual_(node_vectors("previous residuals")),
          previous_displacement_(node_vectors("previous displacements")),
          imposed_(node_vectors("imposed displacements")),
          kept_displacement_(node_vectors("kept displacements")),
          kept_increment_(node_vectors("kept increments")),
          mass_(rest.lumped_mass.transpose().replicate(3, 1)),
          constrained_(Mask::Constant(3, rest.node_count, false)) {
        const CurrentContext current = device_.make_current();
        blocks_.set("Increment", increment_);
        blocks_.set("InverseMass", inverse_mass_);
        blocks_.set("PreviousResidual", previous_residual_);
        blocks_.set("PreviousDisplacement", previous_displacement_);
        blocks_.set("Imposed", imposed_);
        upload_inverse_mass();
        if (shape.patch_tets > 0 && detail::GpuPatches::suit(rest, device_))
            patches_.emplace(device_, programs_, rest, shape, blocks_);
        if (patches_) stress_clock_ = detail::StressClock(rest.viscosity, patches_->stress_pace());
        kept_stress_clock_ = stress_clock_;
        over_patches_ = patches_.has_value();
    }

    void set_conditions(const NodalConditions& conditions) override {
        if (conditions.constrained.cols() != node_count_)
            throw InvalidInput("the conditions are for " + std::to_string(conditions.constrained.cols()) +
                               " nodes; the model has " + std::to_string(node_count_));
        require_shape(conditions.imposed, node_count_, "the imposed displacement");
        const CurrentContext current = device_.make_current();
        effects_.set(conditions, blocks_);
        over_patches_ = patches_ && patches_->take(effects_.on_nodes());
        const auto& contact = conditions.effects.contact;
        if (over_patches_) patches_->set_obstacles(contact ? contact->obstacles.size() : 0, blocks_);
        if (constrained_ != conditions.constrained) {
            constrained_ = conditions.constrained;
            upload_inverse_mass();
        }
        imposed_.upload(detail::packed(conditions.imposed));
        impose();
        state_changed();
    }

    void set_mass(const Matrix3Xd& mass) override {
        require_shape(mass, node_count_, "the mass");
        for (Eigen::Index i = 0; i < mass.size(); ++i)
            if (const double m = mass.reshaped()[i]; !(m > 0) || !std::isfinite(m))
                throw InvalidInput("the mass of node " + std::to_string(i / 3) + " is " + std::to_string(m) +
                                   "; it must be positive");
        const CurrentContext current = device_.make_current();
        mass_ = mass;
        upload_inverse_mass();
        if (patches_) patches_->forget_state();
    }

    void set_state(const Matrix3Xd& displacement, const Matrix3Xd& increment) override {
        require_shape(displacement, node_count_, "the displacement");
        require_shape(increment, node_count_, "the increment");
        const CurrentContext current = device_.make_current();
        displacement_.upload(detail::packed(displacement));
        increment_.upload(detail::packed(increment));
        force_.forget_viscous_stresses();
        stress_clock_.forget();
        impose();
        state_changed();
    }

    void set_increment(const Matrix3Xd& increment) override {
        require_shape(increment, node_count_, "the increment");
        const CurrentContext current = device_.make_current();
        increment_.upload(detail::packed(increment));
        impose();
        state_changed();
    }

    void keep_state() override {
        const CurrentContext current = device_.make_current();
        kept_displacement_.copy_from(displacement_, displacement_.bytes());
        kept_increment_.copy_from(increment_, increment_.bytes());
        force_.keep_viscous_stresses();
        kept_stress_clock_ = stress_clock_;
    }

    void return_to_kept_state() override {
        const CurrentContext current = device_.make_current();
        displacement_.copy_from(kept_displacement_, displacement_.bytes());
        increment_.copy_from(kept_increment_, increment_.bytes());
        force_.return_to_kept_viscous_stresses();
        stress_clock_ = kept_stress_clock_;
        state_changed();
    }

    void run(int steps, const StepCoefficients& coefficients) override {
        const CurrentContext current = device_.make_current();
        const std::vector<detail::GpuSteps> parts = in_parts(std::array{Steps{steps, coefficients}});
        take(parts);
        if (over_patches_ && patches_->gave_up()) take_one_by_one(parts);
    }

    [[nodiscard]] CheckedDisplacement run_and_check(std::span<const Steps> steps) override {
        const CurrentContext current = device_.make_current();
        const std::vector<detail::GpuSteps> parts = in_parts(steps);
        take(parts);
        if (auto found = checked_displacement()) return std::move(*found);
        take_one_by_one(parts);
        return checked_displacement().value();
    }

    [[nodiscard]] Matrix3Xd displacement() const override { return downloaded(displacement_); }
    [[nodiscard]] Matrix3Xd increment() const override { return downloaded(increment_); }

    [[nodiscard]] Matrix3Xd residual() override {
        const CurrentContext current = device_.make_current();
        evaluate(displacement_, effects_.on_nodes(), MaskConstrained::Yes, residual_);
        return downloaded(residual_);
    }

    [[nodiscard]] Matrix3Xd internal_force() override {
        const CurrentContext current = device_.make_current();
        evaluate(displacement_, {}, MaskConstrained::No, residual_, stress_clock_.lag());
        return -downloaded(residual_);
    }

    [[nodiscard]] Observation observe() override {
        const CurrentContext current = device_.make_current();
        if (!previous_residual_known_) find_previous_residual();
        evaluate(displacement_, effects_.on_nodes(), MaskConstrained::Yes, residual_);
        Observation seen = observation_.nodes(node_program(shaders::observe_nodes_program()), blocks_);
        const SmallestJacobian smallest = observation_.smallest_jacobian(force_, blocks_);
        seen.min_jacobian = smallest.value;
        seen.min_jacobian_tet = smallest.tet;
        return seen;
    }

    [[nodiscard]] bool admits_inversion() const override { return admits_inversion_; }

    [[nodiscard]] SmallestJacobian smallest_jacobian() override {
        const CurrentContext current = device_.make_current();
        blocks_.set("Displacement", displacement_);
        return observation_.smallest_jacobian(force_, blocks_);
    }

    [[nodiscard]] std::string description() const override {
        const std::string steps = over_patches_ ? "patches " + name_of(patches_->shape()) : name_of(GpuStepShape{});
        return "GPU " + device_.renderer() + " (OpenGL " + device_.version().substr(0, 3) + "), " + steps;
    }

    [[nodiscard]] std::vector<StepPass> step_passes() override {
        const CurrentContext current = device_.make_current();
        blocks_.set("Displacement", displacement_);
        std::vector<detail::Pass> passes;
        if (over_patches_) {
            passes = patches_->passes(effects_.on_nodes());
        } else {
            if (effects_.surface_pass()) passes.push_back(*effects_.surface_pass());
            for (const detail::Pass& pass : force_.passes()) passes.push_back(pass);
            passes.push_back(
                {&node_program(shaders::node_step_program(effects_.on_nodes(), StoreResidual::No)), nodes()});
        }
        std::vector<StepPass> result;
        for (const detail::Pass& pass : passes) result.push_back(detail::step_pass(pass, blocks_));
        return result;
    }

    [[nodiscard]] Processor processor() const override { return Processor::Gpu; }
    [[nodiscard]] double precision() const override {
        return static_cast<double>(std::numeric_limits<float>::epsilon());
    }

private:
    [[nodiscard]] std::size_t nodes() const { return static_cast<std::size_t>(node_count_); }
    [[nodiscard]] Buffer<Float4> node_vectors(const char* what) const { return {device_, nodes(), what}; }

    void state_changed() {
        previous_residual_known_ = false;
        if (patches_) patches_->forget_state();
    }

    [[nodiscard]] Matrix3Xd downloaded(const Buffer<Float4>& buffer) const {
        const CurrentContext current = device_.make_current();
        return detail::unpacked(buffer.download());
    }

    /// A program over nodes, whose uniform 0 is their number.
    const Program& node_program(const shaders::ProgramSource& source) {
        const Program& program = programs_.get(source);
        program.set(0, static_cast<std::uint32_t>(node_count_));
        return program;
    }

    /// Inverse mass zero holds a component: it needs no mask and no branch in the step.
    void upload_inverse_mass() {
        const Matrix3Xd inverse = constrained_.select(Matrix3Xd::Zero(3, node_count_), mass_.cwiseInverse());
        inverse_mass_.upload(detail::packed(inverse));
    }

    void run_over_nodes(const Program& program) {
        blocks_.bind(program);
        program.dispatch(nodes());
        shaders::storage_barrier();
    }

    void impose() {
        if (!constrained_.any()) return;
        blocks_.set("Displacement", displacement_);
        run_over_nodes(node_program(shaders::impose_program()));
        shaders::check_errors("imposed displacements");
    }

    [[nodiscard]] std::vector<detail::GpuSteps> in_parts(std::span<const Steps> steps) {
        std::vector<detail::GpuSteps> result;
        for (const auto& [count, coefficients] : steps)
            if (count > 0) result.push_back({stress_clock_.next(count, coefficients.time_step), coefficients});
        return result;
    }

    /// Over patches they may give up, and leave the nodes as they are.
    void take(const std::vector<detail::GpuSteps>& steps) {
        if (steps.empty()) return;
        if (over_patches_) {
            blocks_.set("Displacement", displacement_);
            patches_->run(steps, effects_.on_nodes(), blocks_);
            previous_residual_known_ = false;
        } else {
            for (const auto& [parts, coefficients] : steps) run_two_passes(parts, coefficients);
        }
    }

    void take_one_by_one(const std::vector<detail::GpuSteps>& steps) {
        patches_->take_one_by_one();
        take(steps);
    }

    /// Nothing where patches gave up.
    [[nodiscard]] std::optional<CheckedDisplacement> checked_displacement() {
        blocks_.set("Displacement", displacement_);
        const shaders::StorageBuffer& partials = observation_.reduce_elements(force_, blocks_);
        std::vector pieces{shaders::Readback::Piece{displacement_, displacement_.bytes()},
                           shaders::Readback::Piece{partials, partials.bytes()}};
        if (patches_) pieces.push_back({patches_->progress(), patches_->progress().bytes()});
        if (!readback_)
            readback_.emplace(device_, shaders::Readback::bytes_of(pieces), "displacements on their way down");
        const auto fetched = readback_->fetch(pieces);
        if (over_patches_ && patches_->gave_up(fetched[2])) return std::nullopt;
        return CheckedDisplacement{detail::unpacked({reinterpret_cast<const Float4*>(fetched[0].data()), nodes()}),
                                   observation_.smallest_of(fetched[1])};
    }

    void run_two_passes(const std::vector<detail::StressSteps>& parts, const StepCoefficients& coefficients) {
        const Program& step = node_program(shaders::node_step_program(effects_.on_nodes(), StoreResidual::No));
        const Program& last = node_program(shaders::node_step_program(effects_.on_nodes(), StoreResidual::Yes));
        for (const Program* program : {&step, &last}) {
            program->set(1, static_cast<float>(coefficients.momentum));
            program->set(2, static_cast<float>(coefficients.gain));
            effects_.set_time_step(*program, coefficients.time_step);
        }
        blocks_.set("Displacement", displacement_);
        blocks_.set("Residual", previous_residual_);
        force_.bind(blocks_);
        effects_.bind(blocks_);
        blocks_.bind(last);
        int taken = 0;
        for (const auto& part : parts) {
            force_.set_stress_interval(part.interval);
            for (int i = 0; i < part.count; ++i) {
                const bool ends = i + 1 == part.count && &part == &parts.back();
                take_step(ends ? last : step, part.interval > 0 ? detail::Advance::Yes : detail::Advance::No);
                if (++taken % steps_per_flush == 0) shaders::flush();
            }
        }
        previous_residual_known_ = true;
        shaders::check_errors("time steps");
    }

    void take_step(const Program& nodes_step, detail::Advance advance) {
        effects_.dispatch();
        force_.dispatch(advance);
        nodes_step.dispatch(nodes());
        shaders::storage_barrier();
    }

    /// f_ext + f_spring − f_int at `displacement`, with the effects named and the viscous stresses after an interval
    /// (s), into `result`.
    void evaluate(const Buffer<Float4>& displacement, const NodeEffects& effects, MaskConstrained mask,
                  const Buffer<Float4>& result, double stress_interval = 0) {
        force_.set_stress_interval(stress_interval);
        blocks_.set("Displacement", displacement);
        blocks_.set("Residual", result);
        force_.bind(blocks_);
        if (effects.surface_force) {
            effects_.bind(blocks_);
            effects_.dispatch();
        }
        force_.dispatch();
        run_over_nodes(node_program(shaders::node_residual_program(effects, mask)));
        shaders::check_errors("residual");
    }

    /// run() keeps the residual of its last step; without one it is evaluated at u − v.
    void find_previous_residual() {
        blocks_.set("Displacement", displacement_);
        run_over_nodes(node_program(shaders::previous_displacement_program()));
        evaluate(previous_displacement_, effects_.on_nodes(), MaskConstrained::Yes, previous_residual_);
        previous_residual_known_ = true;
    }

    shaders::Device device_;
    shaders::ProgramCache programs_;
    int node_count_;
    bool admits_inversion_;
    BlockBuffers blocks_;
    detail::GpuForce force_;
    detail::GpuEffects effects_;
    detail::GpuObservation observation_;
    detail::StressClock stress_clock_, kept_stress_clock_;
    std::optional<detail::GpuPatches> patches_;  ///< absent where patches do not know the scene
    Buffer<Float4> displacement_, increment_, inverse_mass_, residual_, previous_residual_, previous_displacement_,
        imposed_, kept_displacement_, kept_increment_;
    std::optional<shaders::Readback> readback_;  ///< by run_and_check()
    bool over_patches_ = false;                  ///< whether steps take patches, which do not know all effects
    Matrix3Xd mass_;                             ///< 3 × N
    Mask constrained_;
    bool previous_residual_known_ = false;
};

GpuStepShape usual_shape(const RestState& rest, int device) {
    const shaders::Device on(device);
    if (!on.hardware()) return {};
    return suggested_gpu_step_shape(rest.element_count(), element_of(rest), on.limits().multiprocessors);
}

}  // namespace

std::unique_ptr<Engine> make_gpu_engine(const RestState& rest, int device) {
    return make_gpu_engine(rest, device, usual_shape(rest, device));
}

std::unique_ptr<Engine> make_gpu_engine(const RestState& rest, int device, const GpuStepShape& shape) {
    auto engine = std::make_unique<GpuEngine>(rest, device, shape);
    detail::require_right_forces(*engine, rest);
    return engine;
}

}  // namespace tissuewarp::tled
