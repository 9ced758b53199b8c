#pragma once
/// What a registration says against itself, apart from what each term says (terms/).

#include "registration/result.hpp"

namespace tissuewarp::registration::detail {

/// Two decimals, for messages.
std::string to_text(double value);

/// "47 %", for messages.
std::string percent(double share);

/// Doubts about the course of the rounds and the tissue, whatever the data.
std::vector<Doubt> doubts_of_course(const UpdateResult& result);

}  // namespace tissuewarp::registration::detail
