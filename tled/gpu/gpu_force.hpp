#pragma once
/// The element side of the GPU engine: rest data on the device and the passes that leave corner forces. Needs the
/// device's context current, except construction.

#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"
#include "tled/gpu/gpu_layout.hpp"
#include "tled/step_pass.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::tled::detail {

/// Storage buffers by the name of the block that they serve.
class BlockBuffers {
public:
    void set(const std::string& block, const shaders::StorageBuffer& buffer) { buffers_[block] = &buffer; }
    /// Binds what the program declares; throws std::logic_error when a block has no buffer.
    void bind(const shaders::Program& program) const;
    /// Bytes behind a block; throws as bind().
    [[nodiscard]] std::size_t bytes(const std::string& block) const { return buffer(block).bytes(); }

private:
    [[nodiscard]] const shaders::StorageBuffer& buffer(const std::string& block) const;
    std::map<std::string, const shaders::StorageBuffer*> buffers_;
};

/// Whether viscous stresses move on with a pass of the elements.
enum class Advance { No, Yes };

/// Dispatches that may run at the same time.
struct Pass {
    const shaders::Program* program;
    std::size_t invocations;
};
using Stage = std::vector<Pass>;

/// The pass in words.
StepPass step_pass(const Pass& pass, const BlockBuffers& blocks);

class GpuForce {
public:
    GpuForce(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest,
             BlockBuffers& blocks);

    void bind(const BlockBuffers& blocks) const;
    /// Corner forces of whatever is bound as Displacement, each stage followed by a barrier. Where time advances the
    /// viscous stresses at the end of the step are kept.
    void dispatch(Advance advance = Advance::No) const;
    /// Those that dispatch() runs where time advances.
    [[nodiscard]] std::vector<Pass> passes() const;
    /// By which viscous stresses move on, s; 0 leaves them as they are.
    void set_stress_interval(double interval);
    void forget_viscous_stresses();
    void keep_viscous_stresses();
    void return_to_kept_viscous_stresses();
    /// Sets the range of a program over all elements, as chunks/element.glsl has it.
    void set_all_elements(const shaders::Program& program) const;

private:
    void make_stages(shaders::ProgramCache& programs, const RestState& rest,
                     const std::vector<MaterialBlock>& pressure);
    [[nodiscard]] Stage force_stage(shaders::ProgramCache& programs, const RestState& rest, shaders::PressureRule rule,
                                    Advance advance) const;

    /// The buffers of the averaged pressure; absent for T4.
    struct Pressure {
        Pressure(const shaders::Device& device, const GpuPressure& layout, std::size_t element_count);
        shaders::Buffer<float> volume_change, value;
        shaders::Buffer<Uint4> corners;
        shaders::Buffer<Float2> rest;
        shaders::Buffer<std::uint32_t> incidence;
    };

    std::size_t element_count_;
    std::optional<shaders::Buffer<Uint4>> nodes_;
    std::optional<shaders::Buffer<Float4>> rest_, materials_, fibre_;
    std::optional<shaders::Buffer<std::uint32_t>> incidence_;
    shaders::Buffer<Float4> corner_force_;
    std::optional<Pressure> pressure_;
    /// The buffers of viscous tissue; absent in elastic scenes.
    struct Viscous {
        Viscous(const shaders::Device& device, const RestState& rest);
        std::vector<PronySeries> series;  ///< of each material
        std::size_t terms;                ///< the most of a material
        double interval = 0;              ///< s, of the coefficients
        shaders::Buffer<Float2> coefficients;
        shaders::Buffer<Float4> stress, kept;
    };
    std::optional<Viscous> viscous_;
    std::vector<Stage> pressure_stages_;
    Stage force_stage_, advancing_force_stage_;
};

}  // namespace tissuewarp::tled::detail
