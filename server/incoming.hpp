#pragma once
/// Bytes of one client into messages, within limits: memory follows what arrived, not what a header promises.

#include "server/wire.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace tissuewarp::server {

class Incoming {
public:
    explicit Incoming(const Limits& limits) : limits_(&limits) {}

    /// The messages that these bytes complete; those of unknown types are checked and left out. Throws BadMessage.
    std::vector<Frame> feed(ByteView bytes);

    /// Whether a message has begun and not ended.
    [[nodiscard]] bool within_message() const { return header_ || !head_.empty(); }
    /// Of the message that has begun, 0 while its header is not complete.
    [[nodiscard]] std::uint64_t promised_bytes() const { return header_ ? header_->body_bytes : 0; }
    /// Bytes kept for it.
    [[nodiscard]] std::size_t kept_bytes() const { return head_.capacity() + body_.capacity(); }

private:
    ByteView take_head(ByteView bytes);
    ByteView take_body(ByteView bytes);
    [[nodiscard]] bool is_complete() const { return header_ && received_ == header_->body_bytes; }
    void finish(std::vector<Frame>& frames);

    const Limits* limits_;
    Bytes head_, body_;
    std::optional<Header> header_;
    std::uint64_t received_ = 0, crc_ = 0;
};

}  // namespace tissuewarp::server
