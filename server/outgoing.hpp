#pragma once
/// What waits to be sent to one client. Of what shows a state the newest takes the place of what was not begun, so that
/// a client that reads slowly gets less, not later, and what is said after a state arrives after it or a newer one.

#include "server/wire.hpp"

#include <deque>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::server {

/// Messages that are sent one after the other.
struct Parcel {
    std::string key;  ///< of a state: the next of the same key replaces it; empty: an answer, which is kept
    std::vector<std::shared_ptr<const Bytes>> messages;
    bool answers = false;  ///< its first message is kept when the others are replaced
};

class Outgoing {
public:
    void add(const Parcel& parcel);
    /// What is to be sent now; empty when nothing waits.
    [[nodiscard]] ByteView next() const;
    /// So many bytes of it were sent.
    void sent(std::size_t count);
    /// Parcels.
    [[nodiscard]] std::size_t waiting() const { return parcels_.size(); }

private:
    std::deque<Parcel> parcels_;
    std::size_t message_ = 0, offset_ = 0;  // of the first
};

}  // namespace tissuewarp::server
