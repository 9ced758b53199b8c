#include "tests/support/folders.hpp"

namespace tissuewarp::test {

std::filesystem::path source_folder() {
    return TISSUEWARP_SOURCE_DIR;
}

std::filesystem::path binary_folder() {
    return TISSUEWARP_BINARY_DIR;
}

}  // namespace tissuewarp::test
