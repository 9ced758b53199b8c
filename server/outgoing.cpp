#include "server/outgoing.hpp"

#include <algorithm>

namespace tissuewarp::server {

void Outgoing::add(const Parcel& parcel) {
    const bool begun = message_ > 0 || offset_ > 0;
    const auto old = parcel.key.empty() ? parcels_.end()
                                        : std::find_if(parcels_.begin() + (begun ? 1 : 0), parcels_.end(),
                                                       [&](const Parcel& p) { return p.key == parcel.key; });
    if (old == parcels_.end()) {
        parcels_.push_back(parcel);
        return;
    }
    const Parcel answer{"", {old->messages.front()}};
    const bool kept = old->answers;
    *old = parcel;
    if (kept) parcels_.insert(old, answer);
}

ByteView Outgoing::next() const {
    if (parcels_.empty()) return {};
    return ByteView(*parcels_.front().messages[message_]).subspan(offset_);
}

void Outgoing::sent(std::size_t count) {
    const auto& messages = parcels_.front().messages;
    offset_ += count;
    if (offset_ < messages[message_]->size()) return;
    offset_ = 0;
    if (++message_ < messages.size()) return;
    parcels_.pop_front();
    message_ = 0;
}

}  // namespace tissuewarp::server
