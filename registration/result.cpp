#include "registration/result.hpp"

namespace tissuewarp::registration {

std::vector<tled::Spring> LastPulls::of(Origin origin) const {
    std::vector<tled::Spring> result;
    for (const PulledNode& pulled : springs)
        if (pulled.origin == origin) result.push_back(pulled.spring);
    return result;
}

}  // namespace tissuewarp::registration
