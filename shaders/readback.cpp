#include "shaders/readback.hpp"

#include "shaders/detail/gl.hpp"

#include <algorithm>

namespace tissuewarp::shaders {

Readback::Readback(const Device& device, std::size_t bytes, std::string what)
    : device_(device), bytes_(bytes), what_(std::move(what)) {
    const CurrentContext current = device.make_current();
    const auto allocated = static_cast<GLsizeiptr>(std::max<std::size_t>(bytes, 16));
    constexpr GLbitfield access = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    glCreateBuffers(1, &id_);
    glNamedBufferStorage(id_, allocated, nullptr, access | GL_CLIENT_STORAGE_BIT);
    mapped_ = static_cast<const std::byte*>(glMapNamedBufferRange(id_, 0, allocated, access));
    try {
        check_errors("mapping of " + what_);
        if (mapped_ == nullptr)
            throw GpuUnavailable("mapping of " + what_ + ": the driver gives no memory for " + std::to_string(bytes) +
                                 " bytes; take a coarser grid or the CPU");
    } catch (...) {
        glDeleteBuffers(1, &id_);
        throw;
    }
}

Readback::~Readback() {
    detail::release_with_context(device_, [this] {
        glUnmapNamedBuffer(id_);
        glDeleteBuffers(1, &id_);
    });
}

std::span<const std::byte> Readback::fetch(const StorageBuffer& source, std::size_t bytes) {
    source.require_range(0, bytes);
    if (bytes > bytes_)
        throw InvalidInput(std::to_string(bytes) + " bytes of " + source.what_ + " for " + what_ + ", which hold " +
                           std::to_string(bytes_));
    if (bytes == 0) return {};
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glCopyNamedBufferSubData(source.id_, id_, 0, 0, static_cast<GLsizeiptr>(bytes));
    glMemoryBarrier(GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
    glFinish();
    check_errors("download of " + source.what_);
    return {mapped_, bytes};
}

}  // namespace tissuewarp::shaders
