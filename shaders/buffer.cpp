#include "shaders/buffer.hpp"

#include "shaders/detail/gl.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace tissuewarp::shaders {
namespace {

std::string mebibytes(std::size_t bytes) {
    return std::to_string((bytes + (1U << 20U) - 1) >> 20U) + " MiB";
}

/// What dispatches wrote is complete before the transfer that follows.
void transfer_barrier() {
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
}

}  // namespace

StorageBuffer::StorageBuffer(const Device& device, std::size_t bytes, std::string what)
    : device_(&device), bytes_(bytes), what_(std::move(what)) {
    const std::size_t limit = device.limits().storage_buffer_bytes;
    if (bytes > limit)
        throw GpuUnavailable(what_ + " take " + mebibytes(bytes) + ", a storage block of " + device.renderer() +
                             " holds " + mebibytes(limit) + "; take a coarser mesh, a larger device or the CPU engine");
    const CurrentContext current = device.make_current();
    glCreateBuffers(1, &id_);
    // OpenGL knows no empty buffer, and clears words.
    const std::size_t allocated = std::max<std::size_t>((bytes + 3) / 4 * 4, 16);
    // Zeros come from the host: NVIDIA's driver 580 loses an upload of more than 64 KiB that follows
    // glClearNamedBufferData (docs/decisions/gpu_uploads.md).
    const std::vector<std::byte> zeros(allocated);
    glNamedBufferStorage(id_, static_cast<GLsizeiptr>(allocated), zeros.data(), GL_DYNAMIC_STORAGE_BIT);
    try {
        check_errors(mebibytes(bytes) + " for " + what_);
    } catch (...) {
        glDeleteBuffers(1, &id_);
        throw;
    }
}

StorageBuffer::~StorageBuffer() {
    if (id_ == 0) return;
    detail::release_with_context(*device_, [this] { glDeleteBuffers(1, &id_); });
}

StorageBuffer::StorageBuffer(StorageBuffer&& other) noexcept
    : device_(other.device_), bytes_(other.bytes_), what_(std::move(other.what_)), id_(std::exchange(other.id_, 0)) {}

void StorageBuffer::require_range(std::size_t offset, std::size_t bytes) const {
    if (offset > bytes_ || bytes > bytes_ - offset)
        throw InvalidInput("bytes [" + std::to_string(offset) + ", " + std::to_string(offset + bytes) + ") of " +
                           what_ + ", which has " + std::to_string(bytes_));
}

void StorageBuffer::write(std::size_t offset, std::span<const std::byte> bytes) {
    require_range(offset, bytes.size());
    if (bytes.empty()) return;
    transfer_barrier();
    glNamedBufferSubData(id_, static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes.size()), bytes.data());
    check_errors("upload of " + what_);
}

void StorageBuffer::read(std::size_t offset, std::span<std::byte> bytes) const {
    require_range(offset, bytes.size());
    if (bytes.empty()) return;
    transfer_barrier();
    glGetNamedBufferSubData(id_, static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes.size()), bytes.data());
    check_errors("download of " + what_);
}

void StorageBuffer::clear() {
    write(0, std::vector<std::byte>(bytes_));
}

void StorageBuffer::copy_from(const StorageBuffer& source, std::size_t bytes) {
    source.require_range(0, bytes);
    require_range(0, bytes);
    if (bytes == 0) return;
    transfer_barrier();
    glCopyNamedBufferSubData(source.id_, id_, 0, 0, static_cast<GLsizeiptr>(bytes));
    check_errors("copy of " + source.what_);
}

void StorageBuffer::bind(int binding) const {
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, static_cast<GLuint>(binding), id_);
}

}  // namespace tissuewarp::shaders
