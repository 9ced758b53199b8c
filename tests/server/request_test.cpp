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
             {R"({"do": "gather", "spacing_mm": 0})", "0.1 to 50"},
             {R"({"do": "gather", "keep_s": -1})", "keep_s"},
             {R"({"do": "forget", "ids": "a"})", "list of at most 1000"},
             {R"({"do": "update", "use": [[[[[[[[1]]]]]]]]})", "nested"}})
        EXPECT_THAT([&] { parse_request(text); }, ThrowsMessage<InvalidInput>(HasSubstr(word))) << text;
}

TEST(Request, WhatAStylusTouchesIsGatheredUntilAPause) {
    Scene scene;
    const auto ask = [&](const char* text) { apply(parse_request(text), scene); };
    const auto touch = [&](const char* device, double x) {
        scene.take(device, Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0)));
    };
    ask(R"({"do": "gather", "names": ["Stylus Tip"], "id": "Left lobe", "spacing_mm": 2})");
    for (int n = 0; n < 8; ++n) touch("Stylus-Tip", n);
    EXPECT_EQ(scene.touched().size(), 4);
    ask(R"({"do": "gather", "id": "right"})");
    touch("stylus", 90);
    ask(R"({"do": "pause"})");
    EXPECT_THROW(touch("stylus", 95), InvalidInput);
    EXPECT_THAT([&] { ask(R"({"do": "forget", "ids": ["left lobe"]})"); },
                ThrowsMessage<InvalidInput>(HasSubstr("'left lobe'")));
    EXPECT_THROW(ask(R"({"do": "forget", "ids": ["right"], "names": ["touched"]})"), InvalidInput);
    ask(R"({"do": "forget", "ids": ["Left lobe"]})");
    EXPECT_EQ(scene.touched().points(), Eigen::Vector3d(90, 0, 0));
    ask(R"({"do": "forget", "names": ["touched"]})");
    EXPECT_TRUE(scene.touched().empty());
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
