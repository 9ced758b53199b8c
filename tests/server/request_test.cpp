/// Requests, and the folder that they may touch.
#include "server/request.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tissuewarp::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(Request, SaysWhatToDo) {
    const Request request = parse_request(
        R"({"do": "update", "sequence": 7, "use": ["Fixed Surface"], "send": ["field"], "rounds": 3, "align": false})");
    EXPECT_EQ(request.what, Request::Do::Update);
    EXPECT_EQ(request.sequence, 7);
    EXPECT_THAT(request.use, ElementsAre("fixed_surface"));
    EXPECT_THAT(request.send, ElementsAre("field"));
    EXPECT_EQ(request.rounds, 3);
    EXPECT_FALSE(request.align);
    EXPECT_TRUE(request.error_estimate);
}

TEST(Request, WhatItMayNotSay) {
    for (const auto& [text, word] : std::vector<std::pair<const char*, const char*>>{
             {"", "no JSON"},
             {"[1]", "no JSON object"},
             {"{}", "nothing to do"},
             {R"({"do": "destroy"})", "update, follow"},
             {R"({"do": "update", "rounds": 0})", "\"rounds\" is 0"},
             {R"({"do": "update", "rounds": "many"})", "\"rounds\" is \"many\""},
             {R"({"do": "update", "sequence": -1})", "sequence"},
             {R"({"do": "update", "sequence": 1e300})", "sequence"},
             {R"({"do": "update", "tolerance_mm": null})", "tolerance_mm"},
             {R"({"do": "update", "colour": 1})", "there is no \"colour\""},
             {R"({"do": "update", "send": ["everything"]})", "warped and field"},
             {R"({"do": "update", "use": [[[[[[[[1]]]]]]]]})", "nested"}})
        EXPECT_THAT([&] { parse_request(text); }, ThrowsMessage<InvalidInput>(HasSubstr(word))) << text;
}

TEST(Request, FilesLieInTheFolderAlone) {
    const test::TemporaryFolder folder;
    const auto inside = folder.written("us.nii", "x");
    EXPECT_EQ(file_in(folder.path(), "us.nii"), inside);
    EXPECT_EQ(file_in(folder.path(), "new.vtp"), folder / "new.vtp");
    std::filesystem::create_symlink("/etc/passwd", folder / "link");
    std::filesystem::create_directory(folder / "sub");
    for (const char* name : {"", "..", "../x", "/etc/passwd", "sub/x", "sub", "link", ".hidden", "a\nb", "a\\b", "a b"})
        EXPECT_THROW(file_in(folder.path(), name), InvalidInput) << name;
    EXPECT_THAT([&] { file_in({}, "us.nii"); }, ThrowsMessage<InvalidInput>(HasSubstr("--folder")));
}

}  // namespace
}  // namespace tissuewarp::server
