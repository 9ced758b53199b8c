#include "server/outgoing.hpp"

#include <algorithm>

namespace tissuewarp::server {

void Outgoing::add(const Parcel& parcel) {
    const auto begin = parcels_.begin() + (offset_ > 0 ? 1 : 0);
    if (!parcel.key.empty())
        parcels_.erase(std::remove_if(begin, parcels_.end(), [&](const Parcel& old) { return old.key == parcel.key; }),
                       parcels_.end());
    parcels_.push_back(parcel);
}

ByteView Outgoing::next() const {
    if (parcels_.empty()) return {};
    return ByteView(*parcels_.front().bytes).subspan(offset_);
}

void Outgoing::sent(std::size_t count) {
    offset_ += count;
    if (offset_ < parcels_.front().bytes->size()) return;
    parcels_.pop_front();
    offset_ = 0;
}

}  // namespace tissuewarp::server
