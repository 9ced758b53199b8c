/// Files appear complete or not at all.
#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <gtest/gtest.h>

#include <fstream>

namespace tissuewarp {
namespace {

namespace fs = std::filesystem;

class AtomicFiles : public ::testing::Test {
protected:
    fs::path folder = fs::path(::testing::TempDir()) /
                      ("atomic-" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }

    static void write(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }
    static std::string read(const fs::path& path) {
        std::ifstream file(path);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    std::size_t entries() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    }
};

TEST_F(AtomicFiles, CommitReplacesTheDestination) {
    write(folder / "a.txt", "old");
    AtomicFile file(folder / "a.txt");
    write(file.path(), "new");
    EXPECT_EQ(read(folder / "a.txt"), "old");
    file.commit();
    EXPECT_EQ(read(folder / "a.txt"), "new");
    EXPECT_EQ(entries(), 1u);
}

TEST_F(AtomicFiles, NothingIsLeftWithoutCommit) {
    {
        AtomicFile file(folder / "a.txt");
        write(file.path(), "half");
    }
    EXPECT_EQ(entries(), 0u);
}

TEST_F(AtomicFiles, TheTemporaryKeepsTheWholeExtension) {
    const AtomicFile file(folder / "field.nii.gz");
    EXPECT_TRUE(file.path().string().ends_with(".nii.gz"));
    EXPECT_EQ(file.path().parent_path(), folder);
}

TEST_F(AtomicFiles, CommitWithoutAFileThrows) {
    AtomicFile file(folder / "never-written.txt");
    EXPECT_THROW(file.commit(), IoError);
}

TEST_F(AtomicFiles, AFileInPlaceOfAFolderIsRefused) {
    write(folder / "file", "");
    EXPECT_THROW(require_writable_folder(folder / "file"), IoError);
    EXPECT_THROW(require_writable_folder(folder / "file" / "below"), IoError);
}

TEST_F(AtomicFiles, AWritableFolderIsMadeAndLeftEmpty) {
    require_writable_folder(folder / "new" / "deep");
    EXPECT_TRUE(fs::is_empty(folder / "new" / "deep"));
}

}  // namespace
}  // namespace tissuewarp
