#include "registration/result.hpp"

namespace tissuewarp::registration {

std::vector<tled::Spring> LastPulls::of(Origin origin) const {
    std::vector<tled::Spring> result;
    for (const PulledNode& pulled : springs)
        if (pulled.origin == origin) result.push_back(pulled.spring);
    return result;
}

std::vector<std::string> texts(const std::vector<Doubt>& doubts) {
    std::vector<std::string> result;
    for (const Doubt& doubt : doubts) result.push_back(doubt.text);
    return result;
}

}  // namespace tissuewarp::registration
