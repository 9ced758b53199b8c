/// The log: what was written is read, what was half-written is cut off.
#include "server/journal.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace tissuewarp::server {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<Entry> entries_of(const std::filesystem::path& path) {
    std::vector<Entry> entries;
    read_journal(path, "patient", [&](const Entry& entry) { entries.push_back(entry); });
    return entries;
}

void write_three(const std::filesystem::path& path) {
    Journal journal(path, "patient");
    journal.append(Entry::Kind::Taken, 3, Bytes{1, 2, 3});
    journal.append(Entry::Kind::Update, 4, Bytes{});
    journal.append(Entry::Kind::Result, 5, Bytes(1000, 7));
}

TEST(Journal, IsReadAsItWasWritten) {
    const test::TemporaryFolder folder;
    write_three(folder / "log");
    const std::vector<Entry> entries = entries_of(folder / "log");
    ASSERT_EQ(entries.size(), 3u);
    EXPECT_EQ(entries[0].client, 3u);
    EXPECT_EQ(entries[0].payload, (Bytes{1, 2, 3}));
    EXPECT_EQ(entries[1].kind, Entry::Kind::Update);
    EXPECT_EQ(entries[2].payload.size(), 1000u);
}

TEST(Journal, KilledAtAnyByteItGoesOn) {
    const test::TemporaryFolder folder;
    write_three(folder / "whole");
    const auto size = std::filesystem::file_size(folder / "whole");
    for (auto cut = size - 1; cut > 60; cut -= 37) {
        std::filesystem::copy_file(folder / "whole", folder / "log", std::filesystem::copy_options::overwrite_existing);
        std::filesystem::resize_file(folder / "log", cut);
        const std::size_t before = entries_of(folder / "log").size();
        Journal(folder / "log", "patient").append(Entry::Kind::Taken, 9, Bytes{9});
        const std::vector<Entry> entries = entries_of(folder / "log");
        ASSERT_EQ(entries.size(), before + 1) << cut;
        EXPECT_EQ(entries.back().client, 9u);
    }
}

TEST(Journal, OfAnotherPatientOrNone) {
    const test::TemporaryFolder folder;
    write_three(folder / "log");
    EXPECT_THAT([&] { Journal(folder / "log", "another"); }, ThrowsMessage<InvalidInput>(HasSubstr("no log of this")));
    EXPECT_THROW(Journal(folder.written("text", "something else, of somebody else"), "patient"), InvalidInput);
    EXPECT_THROW(Journal(folder / "none" / "log", "patient"), IoError);
}

}  // namespace
}  // namespace tissuewarp::server
