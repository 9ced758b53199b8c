/// Trials of the dial in files: what is written comes back, what is damaged is refused.
#include "study/dial_trial.hpp"

#include "core/errors.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace tissuewarp::study {
namespace {

class DialTable : public testing::Test {
protected:
    const std::filesystem::path path =
        std::filesystem::path(testing::TempDir()) /
        (std::string("dial-") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
    void TearDown() override { std::filesystem::remove(path); }
};

TEST_F(DialTable, EverythingComesBack) {
    const DialTrial timed{7001, registration::DataKind::Partial, {{}, 1.5}, 5.25, 0.5, 0.75, 1.25, 2.5, true, false};
    const DialTrial accurate{7001, registration::DataKind::Labels, {0.5, {}}, 3, 1, 2, 0.25, 0.75, false, true};
    write_dial_trials(path, {timed, accurate});
    const auto read = read_dial_trials(path);
    ASSERT_EQ(read.size(), 2u);
    EXPECT_EQ(read[0].seed, 7001u);
    EXPECT_EQ(read[0].kind, registration::DataKind::Partial);
    EXPECT_EQ(read[0].request.time_s, 1.5);
    EXPECT_FALSE(read[0].request.accuracy_mm);
    EXPECT_EQ(read[0].edge_length_mm, 5.25);
    EXPECT_EQ(read[0].expected_s, 0.5);
    EXPECT_EQ(read[0].seconds, 0.75);
    EXPECT_EQ(read[0].error_mm, 1.25);
    EXPECT_EQ(read[0].estimated_mm, 2.5);
    EXPECT_EQ(read[0].possible, timed.possible);
    EXPECT_EQ(read[0].announced, timed.announced);
    EXPECT_EQ(read[1].kind, registration::DataKind::Labels);
    EXPECT_EQ(read[1].request.accuracy_mm, 0.5);
    EXPECT_FALSE(read[1].request.time_s);
    EXPECT_EQ(read[1].possible, accurate.possible);
    EXPECT_EQ(read[1].announced, accurate.announced);
}

TEST_F(DialTable, DamageIsRefusedWithItsLine) {
    write_dial_trials(path, {DialTrial{}});
    std::stringstream text;
    text << std::ifstream(path).rdbuf();
    const std::string good = text.str();
    const std::string cut = good.substr(0, good.size() - 5);
    std::string word = good;
    word.replace(word.find("labels"), 6, "lapels");
    for (const std::string& damaged : {cut, word}) {
        std::ofstream(path) << damaged;
        EXPECT_THAT([&] { read_dial_trials(path); },
                    testing::ThrowsMessage<InvalidInput>(
                        testing::AllOf(testing::HasSubstr("line 2"), testing::HasSubstr("remove the file"))));
    }
    std::ofstream(path) << "another table\n";
    EXPECT_THROW(read_dial_trials(path), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::study
