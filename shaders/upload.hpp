#pragma once
/// Large data on their way up to a device, which fetches them while the host goes on.

#include "shaders/buffer.hpp"

#include <memory>
#include <span>
#include <string>

namespace tissuewarp::shaders {
namespace detail {
class MappedBuffer;
}

/// Memory of the host that the device reads, mapped for as long as it lives. Members need the context current.
class Upload {
public:
    /// Throws GpuUnavailable when the driver gives no memory; `what` names the contents in that message.
    Upload(const Device& device, std::size_t bytes, std::string what);
    ~Upload();
    Upload(const Upload&) = delete;
    Upload& operator=(const Upload&) = delete;

    /// To be filled, by any thread, before the next send(). Waits until the device has what was sent before.
    [[nodiscard]] std::span<std::byte> room();
    /// The first bytes of what room() gave become those of `target`, for all that the context is told from now on.
    void send(const StorageBuffer& target, std::size_t bytes);

    [[nodiscard]] std::size_t bytes() const;

private:
    std::unique_ptr<detail::MappedBuffer> memory_;
    void* sent_ = nullptr;  // a fence behind the last send
};

}  // namespace tissuewarp::shaders
