/// Digests against the values of FIPS 180-4's examples.
#include "core/sha256.hpp"
#include "core/errors.hpp"

#include <gtest/gtest.h>

#include <fstream>

namespace tissuewarp {
namespace {

std::string digest_of(const std::string& content) {
    const auto path = std::filesystem::path(::testing::TempDir()) /
                      ("sha-" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::ofstream(path, std::ios::binary) << content;
    const std::string digest = sha256_of_file(path);
    std::filesystem::remove(path);
    return digest;
}

TEST(Sha256, OfNothing) {
    EXPECT_EQ(digest_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, OfAbc) {
    EXPECT_EQ(digest_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Sha256, OfAMillionLetters) {
    EXPECT_EQ(digest_of(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, OfAMissingFileThrows) {
    EXPECT_THROW(sha256_of_file("/nonexistent/file"), IoError);
}

}  // namespace
}  // namespace tissuewarp
