#pragma once
/// Time steps of one dispatch each over patches of the mesh (shaders/kernels/patch_step.comp): the fast twin of the two
/// passes over elements and nodes. Needs the device's context current, except construction.

#include "tled/engine.hpp"
#include "tled/gpu/gpu_force.hpp"
#include "tled/gpu/patch_layout.hpp"
#include "tled/gpu/patch_tissue.hpp"
#include "tled/material/stress_clock.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace tissuewarp::tled::detail {

struct GpuSteps {
    std::vector<StressSteps> parts;  ///< one step at least
    StepCoefficients coefficients;
};

class GpuPatches {
public:
    /// Whether patches can compute the scene on the device: one law, no node of more than
    /// most_sharing_patches materials.
    static bool suit(const RestState& rest, const shaders::Device& device);

    GpuPatches(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest,
               const GpuStepShape& shape, BlockBuffers& blocks);

    /// Whether steps over patches know these effects, and the device has storage blocks for them.
    [[nodiscard]] bool take(const shaders::NodeEffects& effects) const;

    /// Advances what is bound as Displacement and Increment, and as ViscousStress where tissue is viscous; or, where a
    /// patch waited too long for its neighbours, leaves it as it was: gave_up() says so.
    void run(const std::vector<GpuSteps>& steps, const shaders::NodeEffects& effects, const BlockBuffers& blocks);
    /// Of the last steps. It waits for them.
    [[nodiscard]] bool gave_up() const;
    /// The same from the bytes of progress().
    [[nodiscard]] bool gave_up(std::span<const std::byte> progress) const;
    [[nodiscard]] const shaders::StorageBuffer& progress() const { return *progress_; }
    /// From now on one step in a dispatch: after steps that gave up.
    void take_one_by_one();
    /// Those of a step within a run.
    [[nodiscard]] std::vector<Pass> passes(const shaders::NodeEffects& effects) const;
    /// As asked for, without many steps in a dispatch once the device has proved unable to run them.
    [[nodiscard]] GpuStepShape shape() const;
    /// Stresses that stay in shared memory move with less than what a dispatch of their own takes.
    [[nodiscard]] StressPace stress_pace() const {
        return sizes_.places > 0 ? StressPace::EveryStep : StressPace::TheirOwn;
    }
    /// Makes room for what slots keep of so many obstacles.
    void set_obstacles(std::size_t count, BlockBuffers& blocks);
    /// Displacement, Increment, masses or conditions were changed from outside.
    void forget_state() { loaded_ = false; }

private:
    using Stages = std::span<const shaders::PatchStages>;
    [[nodiscard]] Stages stages_of_a_step() const;
    /// Steps [begin, end) as counted by step_; between them some nodes are ahead of others, after them none.
    struct Run {
        std::uint32_t begin, end;
        StepCoefficients coefficients;
    };
    /// Dispatches of the stages, `repeats` times, each of which counts `steps` of the run.
    void dispatch(Stages stages, int repeats, int steps, const Run& run, const shaders::NodeEffects& effects,
                  const BlockBuffers& blocks);
    void take_steps(const std::vector<StressSteps>& steps, const StepCoefficients& coefficients,
                    const shaders::NodeEffects& effects, const BlockBuffers& blocks);
    void take_elastic_steps(int steps, const StepCoefficients& coefficients, const shaders::NodeEffects& effects,
                            const BlockBuffers& blocks);
    void take_viscous_steps(const std::vector<StressSteps>& steps, const StepCoefficients& coefficients,
                            const shaders::NodeEffects& effects, const BlockBuffers& blocks);
    /// Of a run, each with its forces at the end.
    void dispatch_steps(Stages stages, int steps, const Run& run, const shaders::NodeEffects& effects,
                        const BlockBuffers& blocks);
    [[nodiscard]] Stages stages_of_first_forces() const;
    [[nodiscard]] int workgroups_of(const shaders::PatchStages& stages) const;
    void set_sizes(const shaders::Program& program, int workgroups) const;
    [[nodiscard]] Run next_steps(int steps, const StepCoefficients& coefficients) const;
    void load(const BlockBuffers& blocks);
    void forget_tangents();
    void store(const BlockBuffers& blocks);

    const shaders::Device& device_;
    shaders::ProgramCache& programs_;
    std::optional<TissueOfPatches> tissue_;
    GpuStepShape shape_;
    bool averages_, many_steps_;
    int storage_blocks_;  ///< that the device offers a program
    std::size_t node_count_, slot_count_, obstacles_ = 0;
    PatchCapacity capacity_;
    int workgroups_;  ///< of a dispatch that persists
    shaders::PatchSizes sizes_;
    std::optional<shaders::Buffer<Uint4>> head_;
    std::optional<shaders::Buffer<float>> rest_, state_, volumes_;
    std::optional<shaders::Buffer<std::uint32_t>> sources_, neighbours_, progress_, node_of_slot_, slot_of_node_;
    std::optional<shaders::Buffer<std::array<std::uint32_t, 2>>> largest_;
    std::optional<shaders::Buffer<Float4>> forces_;
    std::uint32_t step_ = 0;
    bool loaded_ = false;
};

}  // namespace tissuewarp::tled::detail
