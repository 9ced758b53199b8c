#include "registration/matching/gpu/gpu_echo_engine.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace tissuewarp::registration::detail {

using shaders::MatchPass;

namespace {

constexpr float nowhere = 1e30F;  // kernels/match_echo_costs.comp

std::array<std::int32_t, 4> packed4(const std::array<int, 3>& v) {
    return {v[0], v[1], v[2], 0};
}

/// Intensity, gradient magnitude, 1 where something is shown.
std::vector<Float4> explaining(const EchoImages& images) {
    std::vector<Float4> result(images.grey.size());
    for (std::size_t n = 0; n < result.size(); ++n)
        result[n] = {images.grey[n], images.gradient[n], images.shown[n], 0};
    return result;
}

template <class T>
void send(std::optional<shaders::Buffer<T>>& buffer, const shaders::Device& device, std::span<const std::byte> bytes,
          const char* what) {
    reserve(buffer, device, bytes.size() / sizeof(T), what);
    buffer->write(0, bytes);
}

template <class T>
std::span<const std::byte> bytes_of(const std::vector<T>& values) {
    return std::as_bytes(std::span(values));
}

}  // namespace

GpuEchoEngine::GpuEchoEngine(MatchDevice& matching, std::size_t most_values)
    : matching_(matching), most_values_(most_values), search_(matching.device(), 1, "search in ultrasound") {}

EchoCosts GpuEchoEngine::linear_combination(const EchoImages& images, const EchoCostOptions& options) {
    const shaders::Device& device = matching_.device();
    const shaders::CurrentContext current = device.make_current();
    detail::send(room_.fixed, device, bytes_of(images.echo), "echoes");
    detail::send(room_.moving, device, bytes_of(explaining(images)), "what explains echoes");
    return costs_of_shifts(images, windows_of(options), options.ridge,
                           {MatchPass::LinearBricks, MatchPass::LinearWindow, MatchPass::LinearCosts, 10});
}

EchoCosts GpuEchoEngine::structure(const EchoImages& images, const StructureCostOptions& options) {
    const Structure structure = structure_of(images, options.step);
    const shaders::Device& device = matching_.device();
    const shaders::CurrentContext current = device.make_current();
    detail::send(room_.fixed, device, bytes_of(structure.echo), "descriptors of echoes");
    detail::send(room_.moving, device, bytes_of(structure.moving), "descriptors of the moving image");
    detail::send(room_.shown, device, bytes_of(structure.images.shown), "where it shows something");
    return costs_of_shifts(structure.images, windows_of(options), 0,
                           {MatchPass::StructureBricks, MatchPass::StructureWindow, MatchPass::StructureCosts, 2});
}

EchoCosts GpuEchoEngine::costs_of_shifts(const EchoImages& images, const ShiftedWindows& how, double ridge,
                                         const Measure& measure) {
    const BrickWindows windows(images, how.stride, how.window_mm, how.least_share);
    EchoCosts result = costs_to_be(windows, how, images.grid.spacing[0]);
    const std::size_t lattice = result.lattice(), places = result.at.size();
    if (places == 0) return result;
    detail::send(room_.seen, matching_.device(), bytes_of(images.seen), "where echoes are seen");
    send({packed4(images.grid.size),
          packed4(windows.grid().size),
          how.stride,
          how.reach,
          windows.radius(),
          static_cast<std::uint32_t>(places),
          static_cast<float>(1 - how.most_lost),
          static_cast<float>(ridge),
          {}},
         windows);
    const auto bricks = static_cast<std::size_t>(windows.grid().voxel_count());
    const std::size_t most = std::clamp<std::size_t>(most_values_ / (measure.sums * bricks + places), 1, lattice);
    for (std::size_t first = 0; first < lattice; first += most) {
        const std::size_t count = std::min(most, lattice - first);
        search({first, count}, bricks, places, measure);
        const auto found = matching_.fetch(*room_.costs, places * count * sizeof(float));
        tbb::parallel_for(std::size_t{0}, places, [&](std::size_t n) {
            float* costs = result.cost.data() + n * lattice + first;
            std::memcpy(costs, found.data() + n * count * sizeof(float), count * sizeof(float));
            std::replace_if(
                costs, costs + count, [](float cost) { return cost >= nowhere; },
                std::numeric_limits<float>::infinity());
        });
    }
    return result;
}

void GpuEchoEngine::send(const EchoSearchBlock& search, const BrickWindows& windows) {
    const shaders::Device& device = matching_.device();
    search_.upload(std::array{search});
    const std::vector<std::uint32_t> places(windows.places().begin(), windows.places().end());
    std::vector<float> weights;
    for (int d = -windows.radius(); d <= windows.radius(); ++d) weights.push_back(windows.weight(d));
    detail::send(room_.weights, device, bytes_of(weights), "weights of bricks");
    detail::send(room_.shares, device, bytes_of(windows.shares()), "what is seen of windows in ultrasound");
    detail::send(room_.places, device, bytes_of(places), "places sought in ultrasound");
}

void GpuEchoEngine::search(const Batch& batch, std::size_t bricks, std::size_t places, const Measure& measure) {
    const shaders::Device& device = matching_.device();
    for (auto& sums : room_.sums) reserve(sums, device, batch.count * bricks * measure.sums, "sums of bricks");
    reserve(room_.costs, device, batch.count * places, "costs of shifts");
    GpuBlocks common{{"EchoSearch", &search_},       {"EchoWeights", &*room_.weights}, {"EchoSeen", &*room_.seen},
                     {"EchoFixed", &*room_.fixed},   {"EchoMoving", &*room_.moving},   {"EchoShares", &*room_.shares},
                     {"EchoPlaces", &*room_.places}, {"EchoCosts", &*room_.costs}};
    if (room_.shown) common["EchoShown"] = &*room_.shown;
    const auto run = [&](MatchPass pass, std::size_t count, std::size_t source, std::size_t target) {
        const GpuBlocks own{{"EchoSource", &*room_.sums[source]}, {"EchoTarget", &*room_.sums[target]}};
        matching_.program(pass).set(1, static_cast<std::uint32_t>(batch.count));
        matching_.run(pass, batch.count * count, {&common, &own});
    };
    matching_.program(measure.bricks).set(0, static_cast<std::uint32_t>(batch.first));
    run(measure.bricks, bricks, 1, 0);
    matching_.program(measure.window).set(2, std::uint32_t{2});
    run(measure.window, bricks, 0, 1);
    matching_.program(measure.window).set(2, std::uint32_t{1});
    run(measure.window, bricks, 1, 0);
    run(measure.costs, places, 0, 1);
}

}  // namespace tissuewarp::registration::detail
