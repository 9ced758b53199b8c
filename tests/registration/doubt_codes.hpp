#pragma once
/// What a result is doubted for.

#include "registration/result.hpp"

#include <string>
#include <vector>

namespace tissuewarp::registration::test {

inline std::vector<std::string> codes(const std::vector<Doubt>& doubts) {
    std::vector<std::string> result;
    for (const Doubt& doubt : doubts) result.push_back(doubt.code);
    return result;
}

}  // namespace tissuewarp::registration::test
