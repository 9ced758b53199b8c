#pragma once
#include <filesystem>

namespace tissuewarp::test {

/// Of this repository, and of its build. Functions, so that no other file of the tests depends on where they lie.
std::filesystem::path source_folder();
std::filesystem::path binary_folder();

}  // namespace tissuewarp::test
