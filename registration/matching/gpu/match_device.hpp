#pragma once
/// A device that compares images: the intraoperative one there, and the passes that describe what they are shown.
/// Kernels: shaders/kernels/match_*.comp, blocks: shaders/chunks/match*.glsl.

#include "registration/matching/gpu/gpu_match_layout.hpp"
#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"
#include "shaders/readback.hpp"
#include "shaders/upload.hpp"

#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <string>

namespace tissuewarp::registration::detail {

using GpuWords = shaders::Buffer<std::uint32_t>;
using GpuFloats = shaders::Buffer<float>;
/// Storage blocks by name.
using GpuBlocks = std::map<std::string, const shaders::StorageBuffer*>;

/// Makes a buffer hold `size` entries or more: the one there serves if it does. Contents are lost where it does not.
template <class T>
void reserve(std::optional<shaders::Buffer<T>>& buffer, const shaders::Device& device, std::size_t size,
             const char* what) {
    if (buffer && buffer->size() >= size) return;
    buffer.reset();
    buffer.emplace(device, size, what);
}

/// Descriptors of an image on a grid, and the voxels where they count.
struct DescribedOnDevice {
    imaging::Geometry grid;
    const GpuWords& words;  ///< three a voxel
    const GpuWords& shown;  ///< one a voxel
};

/// All members but the first four, begin_smoothing(), reserve_wide() and samples() need the context current.
class MatchDevice {
public:
    explicit MatchDevice(int gpu_index);

    [[nodiscard]] const shaders::Device& device() const { return device_; }
    void set_image(const imaging::Volume& fixed);
    /// What that image shows.
    void set_seen(const imaging::Volume& seen);

    /// Begins to smooth the image for working grids of a spacing, which fixed_for() will ask for.
    void begin_smoothing(double spacing);
    /// The intraoperative image as match_sample reads it, smoothed for working grids of a spacing; and what it shows.
    /// `wide` is the grid that is to be sampled, whose block MatchGrid is uploaded.
    GpuBlocks fixed_for(const imaging::Geometry& wide, double spacing, const Eigen::Isometry3d& placement,
                        const std::array<int, 3>& cells);
    /// Room for passes over that many voxels of a wide grid.
    void reserve_wide(std::size_t voxels);
    /// Where samples of the wide grid go.
    [[nodiscard]] GpuBlocks samples() const;
    /// Descriptors of what samples() hold, on the wide grid without its rim, three words a voxel.
    void describe(const imaging::Geometry& wide, const GpuWords& words, const GpuWords& shown);

    const shaders::Program& program(shaders::MatchPass pass);
    /// Runs a pass with the blocks that it knows; a name may be in several maps, and the last one has it.
    void run(shaders::MatchPass pass, std::size_t invocations, std::initializer_list<const GpuBlocks*> blocks);
    /// The first entries of a buffer, as long as nothing else is fetched.
    [[nodiscard]] std::span<const std::byte> fetch(const shaders::StorageBuffer& source, std::size_t bytes);
    /// The same of several, for which the host waits once.
    [[nodiscard]] std::vector<std::span<const std::byte>> fetch(std::span<const shaders::Readback::Piece> pieces);

private:
    /// What passes over a wide grid leave for each other.
    struct Scratch {
        GpuFloats value;
        GpuWords seen;
        std::array<GpuWords, 2> eroded;
        std::array<std::array<GpuFloats, 6>, 2> distance;

        Scratch(const shaders::Device& device, std::size_t wide);
    };
    /// The fixed image smoothed for a spacing.
    struct Smoothed {
        std::optional<GpuFloats> voxels;
        bool current = false;
    };

    /// The intraoperative image.
    struct Fixed {
        imaging::Volume image;
        std::optional<GpuFloats> voxels, blurred;
        std::optional<GpuWords> seen;
        std::map<double, Smoothed> smoothed;  // by spacing, mm
        std::unique_ptr<shaders::Upload> image_upload, seen_upload;
    };
    /// The way down, for as many bytes as were ever asked for.
    struct Down {
        std::unique_ptr<shaders::Readback> way;
        std::size_t bytes = 0;
    };

    shaders::Device device_;
    shaders::ProgramCache programs_;
    shaders::Buffer<MatchGridBlock> grid_;
    shaders::Buffer<std::array<float, 2>> partial_;
    GpuFloats mean_;
    Fixed fixed_;
    std::optional<Scratch> scratch_;
    Down down_;

    void send(std::unique_ptr<shaders::Upload>& way, std::span<const std::byte> bytes,
              const shaders::StorageBuffer& target);
    const GpuFloats& smoothed_for(double spacing);
    void blur(std::uint32_t axis, double deviation_mm, const GpuFloats& from, const GpuFloats& to);
    void erode(std::size_t wide, std::uint32_t axis, const GpuWords& from, const GpuWords& to);
};

}  // namespace tissuewarp::registration::detail
