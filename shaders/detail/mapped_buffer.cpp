#include "shaders/detail/mapped_buffer.hpp"

#include <algorithm>
#include <utility>

namespace tissuewarp::shaders::detail {

MappedBuffer::MappedBuffer(const Device& device, std::size_t bytes, std::string what, GLbitfield direction)
    : device_(device), bytes_(bytes), what_(std::move(what)) {
    const CurrentContext current = device.make_current();
    const auto allocated = static_cast<GLsizeiptr>(std::max<std::size_t>(bytes, 16));
    const GLbitfield access = direction | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    glCreateBuffers(1, &id_);
    glNamedBufferStorage(id_, allocated, nullptr, access | GL_CLIENT_STORAGE_BIT);
    data_ = static_cast<std::byte*>(glMapNamedBufferRange(id_, 0, allocated, access));
    try {
        check_errors("mapping of " + what_);
        if (data_ == nullptr)
            throw GpuUnavailable("mapping of " + what_ + ": the driver gives no memory for " + std::to_string(bytes) +
                                 " bytes; take a coarser grid or the CPU");
    } catch (...) {
        glDeleteBuffers(1, &id_);
        throw;
    }
}

MappedBuffer::~MappedBuffer() {
    release_with_context(device_, [this] {
        glUnmapNamedBuffer(id_);
        glDeleteBuffers(1, &id_);
    });
}

}  // namespace tissuewarp::shaders::detail
