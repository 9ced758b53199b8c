#pragma once
/// Memory of the host that a device reads or writes, mapped for as long as it lives.

#include "shaders/detail/gl.hpp"

#include <cstddef>
#include <string>

namespace tissuewarp::shaders::detail {

class MappedBuffer {
public:
    /// `direction`: GL_MAP_READ_BIT or GL_MAP_WRITE_BIT, as the host takes it. Throws GpuUnavailable when the driver
    /// gives no memory; `what` names the contents in that message.
    MappedBuffer(const Device& device, std::size_t bytes, std::string what, GLbitfield direction);
    ~MappedBuffer();
    MappedBuffer(const MappedBuffer&) = delete;
    MappedBuffer& operator=(const MappedBuffer&) = delete;

    [[nodiscard]] GLuint id() const { return id_; }
    [[nodiscard]] std::byte* data() const { return data_; }
    [[nodiscard]] std::size_t bytes() const { return bytes_; }
    [[nodiscard]] const std::string& what() const { return what_; }
    [[nodiscard]] const Device& device() const { return device_; }

private:
    const Device& device_;
    std::size_t bytes_;
    std::string what_;
    GLuint id_ = 0;
    std::byte* data_ = nullptr;
};

}  // namespace tissuewarp::shaders::detail
