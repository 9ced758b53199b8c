#pragma once
/// What waits to be sent to one client. Of what shows a state the newest takes the place of what was not begun, so that
/// a client that reads slowly gets less, not later.

#include "server/wire.hpp"

#include <deque>
#include <memory>
#include <string>

namespace tissuewarp::server {

struct Parcel {
    std::string key;  ///< of a state: the next of the same key replaces it; empty: an answer, which is kept
    std::shared_ptr<const Bytes> bytes;
};

class Outgoing {
public:
    void add(const Parcel& parcel);
    /// What is to be sent now; empty when nothing waits.
    [[nodiscard]] ByteView next() const;
    /// So many bytes of it were sent.
    void sent(std::size_t count);
    [[nodiscard]] std::size_t waiting() const { return parcels_.size(); }

private:
    std::deque<Parcel> parcels_;
    std::size_t offset_ = 0;  // of the first
};

}  // namespace tissuewarp::server
