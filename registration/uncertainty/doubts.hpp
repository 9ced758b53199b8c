#pragma once
/// What a registration says against itself.

#include "registration/pipeline.hpp"

namespace tissuewarp::registration::detail {

/// Two decimals, for messages.
std::string to_text(double value);

/// Reasons not to trust a result, in words that name the remedy; empty when there are none.
std::vector<std::string> doubts(const PreparedModel& prepared, const Intraoperative& seen, const UpdateResult& result);

}  // namespace tissuewarp::registration::detail
