#include "registration/matching/gpu/match_device.hpp"

#include "core/errors.hpp"
#include "registration/matching/points/template_images.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <vector>

namespace tissuewarp::registration::detail {

using shaders::MatchPass;
using shaders::Program;

namespace {

void require_limits(const shaders::Device& device) {
    constexpr int blocks_of_smooth = 13;
    if (device.limits().storage_blocks < blocks_of_smooth)
        throw GpuUnavailable("image matching: " + device.renderer() + " offers " +
                             std::to_string(device.limits().storage_blocks) +
                             " storage blocks per shader; it needs 13; take another device or the CPU");
}

std::array<GpuFloats, 6> distance_maps(const shaders::Device& device, std::size_t wide) {
    const auto map = [&] { return GpuFloats(device, wide, "patch distances"); };
    return {map(), map(), map(), map(), map(), map()};
}

/// Blocks of six maps, by the beginning of their names.
GpuBlocks maps(const std::string& name, const std::array<GpuFloats, 6>& buffers) {
    GpuBlocks blocks;
    for (std::size_t pair = 0; pair < buffers.size(); ++pair) blocks[name + std::to_string(pair)] = &buffers[pair];
    return blocks;
}

}  // namespace

MatchDevice::Scratch::Scratch(const shaders::Device& device, std::size_t wide)
    : value(device, wide, "image on the working grid"),
      seen(device, wide, "what it shows"),
      eroded{GpuWords(device, wide, "what descriptors show"), GpuWords(device, wide, "what descriptors show")},
      distance{distance_maps(device, wide), distance_maps(device, wide)} {}

MatchDevice::MatchDevice(int gpu_index)
    : device_(gpu_index),
      programs_(device_),
      grid_(device_, 1, "grids of matching"),
      partial_(device_, shaders::match_partials, "partial sums of differences"),
      mean_(device_, 1, "mean difference") {
    require_limits(device_);
}

void MatchDevice::set_image(const imaging::Volume& fixed) {
    fixed_.image = fixed;
    const std::size_t voxels = fixed_.image.voxels.total();
    reserve(fixed_.voxels, device_, voxels, "fixed image");
    reserve(fixed_.blurred, device_, voxels, "fixed image along one axis");
    const shaders::CurrentContext current = device_.make_current();
    send(fixed_.image_upload, std::as_bytes(std::span(fixed_.image.data<float>(), voxels)), *fixed_.voxels);
    for (auto& [spacing, smoothed] : fixed_.smoothed) smoothed.current = false;
}

void MatchDevice::set_seen(const imaging::Volume& seen) {
    const std::size_t voxels = seen.voxels.total();
    reserve(fixed_.seen, device_, (voxels + 3) / 4, "what the fixed image shows");
    const shaders::CurrentContext current = device_.make_current();
    send(fixed_.seen_upload, std::as_bytes(std::span(seen.data<std::uint8_t>(), voxels)), *fixed_.seen);
}

/// In all threads: one alone takes longer than the way to the device.
void MatchDevice::send(std::unique_ptr<shaders::Upload>& way, std::span<const std::byte> bytes,
                       const shaders::StorageBuffer& target) {
    if (!way || way->bytes() < bytes.size()) {
        way.reset();
        way = std::make_unique<shaders::Upload>(device_, bytes.size(), "the fixed image on its way up");
    }
    const std::span<std::byte> room = way->room();
    constexpr std::size_t piece = std::size_t{1} << 18U;
    tbb::parallel_for(std::size_t{0}, (bytes.size() + piece - 1) / piece, [&](std::size_t n) {
        const auto some = bytes.subspan(n * piece, std::min(piece, bytes.size() - n * piece));
        std::memcpy(room.data() + n * piece, some.data(), some.size());
    });
    way->send(target, bytes.size());
}

const Program& MatchDevice::program(MatchPass pass) {
    return programs_.get(shaders::match_program(pass, descriptor_reach));
}

void MatchDevice::run(MatchPass pass, std::size_t invocations, std::initializer_list<const GpuBlocks*> blocks) {
    const Program& what = program(pass);
    const GpuBlocks grids{{"MatchGrid", &grid_}};
    std::vector<const GpuBlocks*> with_grids{&grids};
    with_grids.insert(with_grids.end(), blocks.begin(), blocks.end());
    for (const shaders::StorageBlock& block : what.storage_blocks())
        for (const GpuBlocks* known : with_grids)
            if (const auto found = known->find(block.name); found != known->end()) found->second->bind(block.binding);
    what.dispatch(invocations);
    shaders::storage_barrier();
}

GpuBlocks MatchDevice::fixed_for(const imaging::Geometry& wide, double spacing, const Eigen::Isometry3d& placement,
                                 const std::array<int, 3>& cells) {
    grid_.upload(std::array{match_grid_block(wide, fixed_.image.geometry, cells, placement)});
    return {{"MatchFixed", &smoothed_for(spacing)}, {"MatchFixedSeen", &*fixed_.seen}};
}

void MatchDevice::begin_smoothing(double spacing) {
    const shaders::CurrentContext current = device_.make_current();
    const imaging::Geometry& fixed = fixed_.image.geometry;
    grid_.upload(std::array{match_grid_block(fixed, fixed, {1, 1, 1}, Eigen::Isometry3d::Identity())});
    smoothed_for(spacing);
    shaders::flush();
}

const GpuFloats& MatchDevice::smoothed_for(double spacing) {
    Smoothed& smoothed = fixed_.smoothed[spacing];
    reserve(smoothed.voxels, device_, fixed_.image.voxels.total(), "smoothed image");
    if (!smoothed.current) {
        const double deviation = working_deviation(spacing);
        blur(0, deviation, *fixed_.voxels, *smoothed.voxels);
        blur(1, deviation, *smoothed.voxels, *fixed_.blurred);
        blur(2, deviation, *fixed_.blurred, *smoothed.voxels);
        smoothed.current = true;
    }
    return *smoothed.voxels;
}

void MatchDevice::blur(std::uint32_t axis, double deviation_mm, const GpuFloats& from, const GpuFloats& to) {
    const GpuBlocks own{{"MatchSource", &from}, {"MatchTarget", &to}};
    program(MatchPass::Blur).set(0, axis);
    program(MatchPass::Blur)
        .set(1, static_cast<float>(deviation_mm / fixed_.image.geometry.spacing[static_cast<Eigen::Index>(axis)]));
    run(MatchPass::Blur, fixed_.image.voxels.total(), {&own});
}

void MatchDevice::reserve_wide(std::size_t voxels) {
    if (scratch_ && scratch_->value.size() >= voxels) return;
    scratch_.reset();
    scratch_.emplace(device_, voxels);
}

GpuBlocks MatchDevice::samples() const {
    return {{"MatchValue", &scratch_->value}, {"MatchSeen", &scratch_->seen}};
}

void MatchDevice::describe(const imaging::Geometry& wide, const GpuWords& words, const GpuWords& shown) {
    const auto count = static_cast<std::size_t>(wide.voxel_count());
    Scratch& s = *scratch_;
    GpuBlocks blocks = samples();
    blocks["MatchPartial"] = &partial_;
    blocks["MatchMean"] = &mean_;
    blocks["MatchDescriptors"] = &words;
    blocks["MatchShown"] = &shown;
    const auto workgroup = static_cast<std::size_t>(program(MatchPass::Difference).workgroup_size());
    run(MatchPass::Difference, shaders::match_partials * workgroup, {&blocks});
    run(MatchPass::Mean, shaders::match_partials, {&blocks});
    const GpuBlocks to_first = maps("MatchSmoothed", s.distance[0]), to_second = maps("MatchSmoothed", s.distance[1]),
                    first = maps("MatchDistance", s.distance[0]), second = maps("MatchDistance", s.distance[1]);
    run(MatchPass::Distance, count, {&blocks, &to_first});
    program(MatchPass::Smooth).set(0, std::uint32_t{1});
    run(MatchPass::Smooth, count, {&blocks, &first, &to_second});
    program(MatchPass::Smooth).set(0, std::uint32_t{2});
    run(MatchPass::Smooth, count, {&blocks, &second, &to_first});
    erode(count, 0, s.seen, s.eroded[0]);
    erode(count, 1, s.eroded[0], s.eroded[1]);
    erode(count, 2, s.eroded[1], s.eroded[0]);
    const GpuBlocks eroded{{"MatchSeen", &s.eroded[0]}};
    run(MatchPass::Describe, shown.size(), {&blocks, &first, &eroded});
}

void MatchDevice::erode(std::size_t wide, std::uint32_t axis, const GpuWords& from, const GpuWords& to) {
    const GpuBlocks own{{"MatchMaskSource", &from}, {"MatchMaskTarget", &to}};
    program(MatchPass::Erode).set(0, axis);
    run(MatchPass::Erode, wide, {&own});
}

std::span<const std::byte> MatchDevice::fetch(const shaders::StorageBuffer& source, std::size_t bytes) {
    return fetch(std::array{shaders::Readback::Piece{source, bytes}}).front();
}

std::vector<std::span<const std::byte>> MatchDevice::fetch(std::span<const shaders::Readback::Piece> pieces) {
    const std::size_t bytes = shaders::Readback::bytes_of(pieces);
    if (bytes > down_.bytes) {
        down_.way.reset();
        down_.way = std::make_unique<shaders::Readback>(device_, bytes, "results of matching on their way down");
        down_.bytes = bytes;
    }
    return down_.way->fetch(pieces);
}

}  // namespace tissuewarp::registration::detail
