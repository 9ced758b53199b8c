#pragma once
/// Ultrasound compared in shaders: shaders/kernels/match_echo_*.comp.

#include "registration/matching/gpu/match_device.hpp"
#include "registration/matching/ultrasound/echo_engine.hpp"

namespace tissuewarp::registration::detail {

/// The storage block EchoSearch.
struct EchoSearchBlock {
    std::array<std::int32_t, 4> voxel_count, brick_count;
    std::int32_t brick_side, shift_reach, window_radius;
    std::uint32_t place_count;
    float least_kept, ridge;
    std::array<float, 2> padding;
};

/// Costs differ from the processor's by rounding. Throws GpuUnavailable where the images do not fit onto the device.
class GpuEchoEngine : public EchoEngine {
public:
    /// `matching` outlives the engine. Shifts are looked at in batches that leave no more sums and costs than that.
    explicit GpuEchoEngine(MatchDevice& matching, std::size_t most_values = std::size_t{1} << 23U);

    EchoCosts linear_combination(const EchoImages& images, const EchoCostOptions& options) override;
    EchoCosts structure(const EchoImages& images, const StructureCostOptions& options) override;

private:
    /// The passes of one measure of likeness, and how many sums it has.
    struct Measure {
        shaders::MatchPass bricks, window, costs;
        std::size_t sums;
    };
    /// What the passes read and leave.
    struct Room {
        std::optional<GpuFloats> seen, shown, weights, shares, costs;
        std::optional<GpuWords> fixed, moving, places;
        std::array<std::optional<GpuFloats>, 2> sums;
    };
    /// Shifts that are looked at together, of the cube of all of them.
    struct Batch {
        std::size_t first, count;
    };

    MatchDevice& matching_;
    std::size_t most_values_;
    shaders::Buffer<EchoSearchBlock> search_;
    Room room_;

    /// Of images that were sent.
    EchoCosts costs_of_shifts(const EchoImages& images, const ShiftedWindows& how, double ridge,
                              const Measure& measure);
    void send(const EchoSearchBlock& search, const BrickWindows& windows);
    /// Leaves the costs of a batch.
    void search(const Batch& batch, std::size_t bricks, std::size_t places, const Measure& measure);
};

}  // namespace tissuewarp::registration::detail
