#include "server/incoming.hpp"

#include "server/crc64.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace tissuewarp::server {

namespace {

bool is_known(std::string_view type) {
    static constexpr std::array<std::string_view, 6> known{"TRANSFORM", "POINT",  "POLYDATA",
                                                           "IMAGE",     "STRING", "STATUS"};
    return std::find(known.begin(), known.end(), type) != known.end();
}

}  // namespace

ByteView Incoming::take_head(ByteView bytes) {
    const std::size_t count = std::min(bytes.size(), header_bytes - head_.size());
    head_.insert(head_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    if (head_.size() == header_bytes) {
        header_ = parse_header(head_, *limits_);
        head_.clear();
    }
    return bytes.subspan(count);
}

ByteView Incoming::take_body(ByteView bytes) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), header_->body_bytes - received_));
    const ByteView taken = bytes.first(count);
    crc_ = crc64(taken, crc_);
    if (is_known(header_->type)) body_.insert(body_.end(), taken.begin(), taken.end());
    received_ += count;
    return bytes.subspan(count);
}

void Incoming::finish(std::vector<Frame>& frames) {
    if (crc_ != header_->crc)
        throw BadMessage("the checksum of a message " + header_->type + " is not that of its bytes");
    if (is_known(header_->type)) frames.push_back({std::move(*header_), std::move(body_)});
    header_.reset();
    body_ = {};
    received_ = crc_ = 0;
}

std::vector<Frame> Incoming::feed(ByteView bytes) {
    std::vector<Frame> frames;
    while (!bytes.empty() || is_complete()) {
        if (!header_)
            bytes = take_head(bytes);
        else if (!is_complete())
            bytes = take_body(bytes);
        if (is_complete()) finish(frames);
    }
    return frames;
}

}  // namespace tissuewarp::server
