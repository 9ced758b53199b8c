// The passes of the warp on a device: clear the owners of the voxels, elements to affine inverse fields, rasterise,
// read the moving image at every voxel. Kernels: shaders/kernels/warp_*.comp, blocks: shaders/chunks/warp*.glsl.

#include "registration/gpu_warp.hpp"

#include "core/errors.hpp"
#include "registration/field/gpu_warp_check.hpp"
#include "registration/field/gpu_warp_layout.hpp"
#include "registration/field/uninitialised.hpp"
#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"
#include "shaders/readback.hpp"
#include "shaders/timer.hpp"

#include <tbb/parallel_for.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <vector>

namespace tissuewarp::registration {

namespace {

using detail::ElementCounts;
using detail::Float4;
using detail::GridBlock;
using detail::Uint4;
using imaging::Geometry;
using imaging::Interpolation;
using imaging::Volume;
using shaders::Buffer;
using shaders::CurrentContext;
using shaders::Program;
using shaders::WarpContinuation;

void require_image(const Volume& moving, Interpolation interpolation) {
    if (moving.empty()) throw InvalidInput("GPU warp: the moving image is empty; give one with voxels");
    imaging::require_valid(moving.geometry, "moving image");
    if (moving.channels() != 1)
        throw InvalidInput("GPU warp: the moving image has " + std::to_string(moving.channels()) +
                           " channels; give one of one channel, or take warp_image()");
    const int depth = moving.voxels.depth();
    if (interpolation == Interpolation::Nearest && depth > CV_32S)
        throw InvalidInput("GPU warp: labels are floating-point; read them with read_labels");
    if (interpolation == Interpolation::Linear && depth != CV_32F && depth > CV_16S)
        throw InvalidInput(
            "GPU warp: voxels of 32-bit integers or float64 do not fit into float32; convert them or take "
            "warp_image()");
    if (!cv::checkRange(moving.voxels))
        throw InvalidInput("GPU warp: the moving image has voxels that are not finite; replace them");
}

void require_limits(const shaders::Device& device) {
    // warp_image with a continuation declares eight blocks; shaders/chunks/warp.glsl counts to 11.
    if (device.limits().storage_blocks < 8 || device.limits().storage_bindings < 12)
        throw GpuUnavailable("GPU warp: " + device.renderer() + " offers " +
                             std::to_string(device.limits().storage_blocks) + " storage blocks per shader and " +
                             std::to_string(device.limits().storage_bindings) +
                             " bindings; the warp needs 8 and 12; take another device or warp on the CPU");
}

void require_space(const shaders::Device& device, const Geometry& grid, const char* what) {
    const auto limit = static_cast<long long>(device.limits().storage_buffer_bytes / sizeof(float));
    if (grid.voxel_count() > limit)
        throw GpuUnavailable("GPU warp: the " + std::string(what) + " has " + std::to_string(grid.voxel_count()) +
                             " voxels, " + device.renderer() + " holds " + std::to_string(limit) +
                             " in a storage block; crop it, take a coarser grid or warp on the CPU");
}

/// Four bytes a voxel, as the device holds them.
Volume in_words(const Volume& image, Interpolation interpolation) {
    return image.as(interpolation == Interpolation::Nearest ? CV_32S : CV_32F);
}

std::span<const std::byte> bytes_of(const Volume& volume) {
    return std::as_bytes(std::span(volume.voxels.data, volume.voxels.total() * volume.voxels.elemSize()));
}

/// Calls copy(first voxel, voxels) for every slice, in parallel: one core alone takes longer over an image than the
/// device.
template <class Copy>
void copy_slices(const Geometry& grid, const Copy& copy) {
    const auto slice = static_cast<std::size_t>(grid.size[0]) * static_cast<std::size_t>(grid.size[1]);
    tbb::parallel_for(std::size_t{0}, static_cast<std::size_t>(grid.size[2]),
                      [&](std::size_t k) { copy(k * slice, slice); });
}

}  // namespace

struct GpuWarp::Impl {
    Geometry moving_grid, output;
    int type;  // of the moving image and the result
    Interpolation interpolation;
    std::uint32_t outside_bits = 0;
    Eigen::Matrix3Xd nodes;  // rest positions, mm, moving frame
    shaders::Device device;
    shaders::ProgramCache programs;
    std::uint32_t element_count, portion_count = 0;
    std::optional<Buffer<GridBlock>> grid;
    std::optional<Buffer<Float4>> node_state, element_field;
    std::optional<Buffer<Uint4>> corners, portions;
    std::optional<Buffer<std::uint32_t>> owner, moving, result;
    std::optional<Buffer<ElementCounts>> counts;
    std::optional<shaders::Readback> readback;
    std::array<std::optional<Buffer<float>>, 3> continuation;
    std::map<std::string, const shaders::StorageBuffer*> blocks;
    std::optional<shaders::GpuTimer> rasterise_timer, resample_timer;
    std::vector<Float4> node_words;
    GpuWarpReport last;

    Impl(const meshing::TetMesh& mesh, const Volume& image, const Geometry& grid_of_output,
         const GpuWarpOptions& options)
        : moving_grid(image.geometry),
          output(grid_of_output),
          type(image.voxels.type()),
          interpolation(options.interpolation),
          nodes(mesh.nodes),
          device(options.gpu_index),
          programs(device),
          element_count(static_cast<std::uint32_t>(mesh.tet_count())) {
        require_limits(device);
        require_space(device, output, "output grid");
        require_space(device, moving_grid, "moving image");
        set_outside(options.outside);
        allocate(mesh, image);
        blocks = {{"WarpGrid", &*grid},     {"WarpNodes", &*node_state},  {"WarpTetrahedra", &*corners},
                  {"WarpOwner", &*owner},   {"WarpPortions", &*portions}, {"WarpElementField", &*element_field},
                  {"WarpMoving", &*moving}, {"WarpResult", &*result},     {"WarpCounts", &*counts}};
    }

    void set_outside(double outside) {
        cv::Mat value(1, 1, CV_64F, cv::Scalar(outside));
        value.convertTo(value, CV_MAT_DEPTH(type));
        value.convertTo(value, interpolation == Interpolation::Nearest ? CV_32S : CV_32F);
        outside_bits = *value.ptr<std::uint32_t>();
    }

    void allocate(const meshing::TetMesh& mesh, const Volume& image) {
        const auto voxels = static_cast<std::size_t>(output.voxel_count());
        const std::vector<Uint4> parts = detail::portions_of(mesh, output);
        Volume words = in_words(image, interpolation);
        portion_count = static_cast<std::uint32_t>(parts.size());
        grid.emplace(device, 1, "grids of the warp");
        node_state.emplace(device, 2 * static_cast<std::size_t>(nodes.cols()), "displacements of the warp");
        element_field.emplace(device, 4 * static_cast<std::size_t>(element_count), "inverse fields of elements");
        corners.emplace(device, detail::corners_of(mesh), "nodes of elements");
        portions.emplace(device, parts, "portions of elements");
        owner.emplace(device, voxels, "elements of voxels");
        moving.emplace(device, bytes_of(words), "moving image");
        result.emplace(device, voxels, "warped image");
        counts.emplace(device, 1, "counts of elements");
        readback.emplace(device, result->bytes(), "the warped image on its way down");
        rasterise_timer.emplace(device);
        resample_timer.emplace(device);
    }

    [[nodiscard]] WarpContinuation continuation_kind() const {
        return continuation[0] ? WarpContinuation::Given : WarpContinuation::None;
    }

    void bind(const Program& program) const {
        for (const shaders::StorageBlock& block : program.storage_blocks()) blocks.at(block.name)->bind(block.binding);
    }

    void run(const Program& program, std::size_t invocations) const {
        bind(program);
        program.dispatch(invocations);
        shaders::storage_barrier();
    }

    void require(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement) const {
        if (displacement.cols() != nodes.cols())
            throw InvalidInput("GPU warp: " + std::to_string(displacement.cols()) + " displacements for " +
                               std::to_string(nodes.cols()) + " nodes; give one each");
        for (Eigen::Index n = 0; n < displacement.cols(); ++n)
            if (!displacement.col(n).allFinite())
                throw InvalidInput("GPU warp: the displacement of node " + std::to_string(n) + " is not finite");
        if (!placement.matrix().allFinite())
            throw InvalidInput("GPU warp: the placement is not finite; give a rigid motion");
    }

    void upload(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement) {
        detail::set_node_words(nodes, displacement, output, placement, node_words);
        node_state->upload(node_words);
        grid->upload(std::array{detail::grid_block(moving_grid, output, placement)});
        counts->upload(std::array{ElementCounts{}});
    }

    void rasterise(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement) {
        upload(displacement, placement);
        last = {};
        const Program& elements = programs.get(shaders::warp_elements_program());
        const Program& rows = programs.get(shaders::warp_rasterise_program());
        const Program& clear = programs.get(shaders::warp_clear_program());
        elements.set(0, element_count);
        rows.set(0, portion_count);
        rasterise_timer->start();
        run(clear, owner->size());
        run(elements, element_count);
        run(rows, std::size_t{portion_count} * shaders::warp_portion_lanes);
        rasterise_timer->stop();
    }

    /// Four bytes a voxel, valid until the next call.
    const std::byte* resample(const Program& program, std::uint32_t uniform) {
        program.set(0, uniform);
        resample_timer->start();
        run(program, result->size());
        resample_timer->stop();
        const std::byte* words = readback->fetch(*result, result->bytes()).data();
        last.resample_seconds += resample_timer->seconds();
        return words;
    }

    void finish_report() {
        last.rasterise_seconds = rasterise_timer->seconds();
        const ElementCounts found = counts->download().front();
        last.flat = static_cast<int>(found.flat);
        // An index triple of other handedness than the patient's turns the sign of every volume.
        const bool mirrored = output.direction.determinant() < 0.0;
        last.inverted = static_cast<int>(mirrored ? element_count - found.flat - found.negative : found.negative);
    }
};

GpuWarp::GpuWarp(const meshing::TetMesh& mesh, const Volume& moving, const Geometry& output,
                 const GpuWarpOptions& options) {
    meshing::require_valid(mesh, "GPU warp");
    if (mesh.tet_count() == 0) throw InvalidInput("GPU warp: the mesh has no elements; give one with tetrahedra");
    imaging::require_valid(output, "output grid");
    require_image(moving, options.interpolation);
    impl_ = std::make_unique<Impl>(mesh, moving, output, options);
    detail::require_right(*this, mesh, moving, output, options);
    impl_->last = {};
}
GpuWarp::~GpuWarp() = default;
GpuWarp::GpuWarp(GpuWarp&&) noexcept = default;
GpuWarp& GpuWarp::operator=(GpuWarp&&) noexcept = default;

void GpuWarp::set_continuation(const Volume& fixed_to_moving, const Eigen::Isometry3d& placement) {
    if (fixed_to_moving.empty() || fixed_to_moving.voxels.type() != CV_32FC3)
        throw InvalidInput(
            "GPU warp: the field must have three channels of float32; give displacement_fixed_to_moving");
    if (!imaging::same_grid(fixed_to_moving.geometry, impl_->output))
        throw InvalidInput("GPU warp: the field lies on another grid than the output, " +
                           std::to_string(imaging::grid_distance(fixed_to_moving.geometry, impl_->output)) +
                           " voxels off; compute it on the output grid");
    if (!placement.matrix().allFinite() || !cv::checkRange(fixed_to_moving.voxels))
        throw InvalidInput("GPU warp: the field or its placement is not finite; give displacement_fixed_to_moving");
    const detail::Row4 rigid = detail::rigid_field(impl_->output, placement);
    const auto& size = impl_->output.size;
    std::vector<float> component(impl_->result->size());
    const auto* field = fixed_to_moving.data<cv::Vec3f>();
    const CurrentContext current = impl_->device.make_current();
    for (int c = 0; c < 3; ++c) {
        std::size_t voxel = 0;
        for (int k = 0; k < size[2]; ++k)
            for (int j = 0; j < size[1]; ++j)
                for (int i = 0; i < size[0]; ++i, ++voxel)
                    component[voxel] =
                        static_cast<float>(field[voxel][c] - rigid.row(c).dot(Eigen::Vector4d(i, j, k, 1.0)));
        auto& buffer = impl_->continuation[static_cast<std::size_t>(c)];
        if (!buffer) buffer.emplace(impl_->device, component.size(), "continuation of the field");
        buffer->upload(component);
        impl_->blocks[std::string("WarpContinuation") + "XYZ"[c]] = &*buffer;
    }
}

void GpuWarp::warp(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement, Volume& result) {
    Impl& impl = *impl_;
    impl.require(displacement, placement);
    const CurrentContext current = impl.device.make_current();
    const bool nearest = impl.interpolation == Interpolation::Nearest;
    const int word_type = nearest ? CV_32SC1 : CV_32FC1;
    const bool fits = !result.empty() && result.voxels.type() == word_type && result.geometry.size == impl.output.size;
    Volume words = fits && impl.type == word_type ? result : detail::uninitialised(impl.output, word_type);
    words.geometry = impl.output;
    impl.rasterise(displacement, placement);
    const Program& program = impl.programs.get(shaders::warp_image_program(
        impl.continuation_kind(), nearest ? shaders::WarpTakes::Nearest : shaders::WarpTakes::Trilinear));
    copy_slices(impl.output,
                [&, from = impl.resample(program, impl.outside_bits)](std::size_t first, std::size_t count) {
                    std::memcpy(words.voxels.data + 4 * first, from + 4 * first, 4 * count);
                });
    impl.finish_report();
    result = words.as(CV_MAT_DEPTH(impl.type));
}

Volume GpuWarp::warp(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement) {
    Volume result;
    warp(displacement, placement, result);
    return result;
}

Volume GpuWarp::field(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement) {
    Impl& impl = *impl_;
    impl.require(displacement, placement);
    const CurrentContext current = impl.device.make_current();
    impl.rasterise(displacement, placement);
    const Program& program = impl.programs.get(shaders::warp_field_program(impl.continuation_kind()));
    Volume result = detail::uninitialised(impl.output, CV_32FC3);
    auto* to = result.data<cv::Vec3f>();
    for (int c = 0; c < 3; ++c) {
        copy_slices(impl.output, [&, from = impl.resample(program, static_cast<std::uint32_t>(c))](std::size_t first,
                                                                                                   std::size_t count) {
            for (std::size_t voxel = first; voxel < first + count; ++voxel)
                std::memcpy(&to[voxel][c], from + sizeof(float) * voxel, sizeof(float));
        });
    }
    impl.finish_report();
    return result;
}

const GpuWarpReport& GpuWarp::report() const {
    return impl_->last;
}
const std::string& GpuWarp::device() const {
    return impl_->device.renderer();
}

}  // namespace tissuewarp::registration
