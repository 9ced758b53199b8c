/// Messages that quote files can be shown and name them.
#include "core/file_message.hpp"

#include <gmock/gmock.h>

namespace tissuewarp {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

TEST(FileMessages, KeepTheirEndsAndLoseWhatNobodyCanRead) {
    EXPECT_EQ(presentable("'a.nrrd': 5 µm"), "'a.nrrd': 5 µm");
    EXPECT_EQ(presentable(std::string("a\0\x1b[2Jb\x7f", 8)), "a??[2Jb?");
    const std::string cut = presentable("'a.nrrd': type '" + std::string(100000, '9') + "'; convert it");
    EXPECT_LT(cut.size(), 1100U);
    EXPECT_THAT(cut, testing::AllOf(StartsWith("'a.nrrd': type '9"), HasSubstr(" … "), EndsWith("'; convert it")));
}

TEST(FileMessages, AreNotCutWithinACharacter) {
    for (std::size_t shift = 0; shift < 3; ++shift) {
        std::string text(shift, 'a');
        for (int n = 0; n < 1000; ++n) text += "é";
        const std::string cut = presentable(text);
        for (std::size_t at = cut.find("é"); at < cut.size();) {
            const bool known = cut.compare(at, 2, "é") == 0 || cut.compare(at, 3, "…") == 0 || cut[at] == ' ';
            ASSERT_TRUE(known) << shift << " " << at;
            at += cut.compare(at, 3, "…") == 0 ? 3 : cut[at] == ' ' ? 1 : 2;
        }
    }
}

TEST(FileMessages, NameTheFileOnce) {
    const auto message_of = [](const std::string& text) -> std::string {
        try {
            naming("scan.h5", [&]() -> int { throw InvalidInput(text); });
        } catch (const InvalidInput& problem) {
            return problem.what();
        }
        return "";
    };
    EXPECT_EQ(message_of("node 3 is not finite"), "'scan.h5': node 3 is not finite");
    EXPECT_EQ(message_of("'scan.h5' is empty"), "'scan.h5' is empty");
    EXPECT_EQ(naming("scan.h5", [] { return 3; }), 3);
    EXPECT_THROW(naming("scan.h5", []() -> int { throw IoError("cut short"); }), IoError);
}

}  // namespace
}  // namespace tissuewarp
