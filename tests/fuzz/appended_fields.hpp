#pragma once
/// XML files of VTK with data behind the text.

#include "tests/fuzz/format.hpp"

namespace tissuewarp::fuzz {

/// Lengths before the appended arrays and the first of their numbers.
std::vector<Field> appended_fields(const std::string& bytes);

}  // namespace tissuewarp::fuzz
