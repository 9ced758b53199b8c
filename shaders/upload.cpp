#include "shaders/upload.hpp"

#include "shaders/detail/gl.hpp"

#include <algorithm>
#include <utility>

namespace tissuewarp::shaders {

Upload::Upload(const Device& device, std::size_t bytes, std::string what)
    : device_(device), bytes_(bytes), what_(std::move(what)) {
    const CurrentContext current = device.make_current();
    const auto allocated = static_cast<GLsizeiptr>(std::max<std::size_t>(bytes, 16));
    constexpr GLbitfield access = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    glCreateBuffers(1, &id_);
    glNamedBufferStorage(id_, allocated, nullptr, access | GL_CLIENT_STORAGE_BIT);
    mapped_ = static_cast<std::byte*>(glMapNamedBufferRange(id_, 0, allocated, access));
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

Upload::~Upload() {
    detail::release_with_context(device_, [this] {
        if (sent_ != nullptr) glDeleteSync(static_cast<GLsync>(sent_));
        glUnmapNamedBuffer(id_);
        glDeleteBuffers(1, &id_);
    });
}

std::span<std::byte> Upload::room() {
    if (sent_ != nullptr) {
        glClientWaitSync(static_cast<GLsync>(sent_), GL_SYNC_FLUSH_COMMANDS_BIT, ~GLuint64{0});
        glDeleteSync(static_cast<GLsync>(std::exchange(sent_, nullptr)));
    }
    return {mapped_, bytes_};
}

void Upload::send(const StorageBuffer& target, std::size_t bytes) {
    target.require_range(0, bytes);
    if (bytes > bytes_)
        throw InvalidInput(std::to_string(bytes) + " bytes for " + target.what() + " from " + what_ + ", which hold " +
                           std::to_string(bytes_));
    if (bytes == 0) return;
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
    glCopyNamedBufferSubData(id_, target.id_, 0, 0, static_cast<GLsizeiptr>(bytes));
    if (sent_ != nullptr) glDeleteSync(static_cast<GLsync>(sent_));
    sent_ = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    check_errors("upload of " + target.what());
}

}  // namespace tissuewarp::shaders
