#pragma once
/// The fast way down for large results: memory of the host that stays mapped, which the device writes itself.

#include "shaders/buffer.hpp"

#include <memory>
#include <span>
#include <vector>

namespace tissuewarp::shaders {
namespace detail {
class MappedBuffer;
}

/// Bytes of the host that a device copies its buffers into. fetch() needs the device's context current; construction
/// and destruction make it so.
class Readback {
public:
    /// Throws GpuUnavailable when the driver does not map that much; `what` names the contents in that message.
    Readback(const Device& device, std::size_t bytes, std::string what);
    ~Readback();
    Readback(const Readback&) = delete;
    Readback& operator=(const Readback&) = delete;

    /// The first `bytes` of `source`, once all that was recorded before is done. The next call overwrites them. Throws
    /// InvalidInput when either side is smaller.
    [[nodiscard]] std::span<const std::byte> fetch(const StorageBuffer& source, std::size_t bytes);

    /// The first bytes of a buffer.
    struct Piece {
        const StorageBuffer& source;
        std::size_t bytes;
    };
    /// Of several buffers, for which the host waits once.
    [[nodiscard]] std::vector<std::span<const std::byte>> fetch(std::span<const Piece> pieces);
    /// What they need room for.
    [[nodiscard]] static std::size_t bytes_of(std::span<const Piece> pieces);

private:
    std::unique_ptr<detail::MappedBuffer> memory_;
};

}  // namespace tissuewarp::shaders
