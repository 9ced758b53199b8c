/// The one direction of dependency: no folder includes a header of a folder that it may not know.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace tissuewarp {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, std::set<std::string>> may_include{
    {"core", {"core"}},
    {"imaging", {"core", "imaging"}},
    {"shaders", {"core", "shaders"}},
    {"meshing", {"core", "meshing"}},  // the mesher, see below, knows images too
    {"tled", {"core", "meshing", "shaders", "tled"}},
    {"simulation", {"core", "imaging", "meshing", "shaders", "tled", "simulation"}},
    {"registration", {"core", "imaging", "meshing", "shaders", "tled", "registration"}},
    {"report", {"core", "imaging", "report"}},
    {"study", {"core", "imaging", "meshing", "shaders", "tled", "registration", "report", "study"}},
    {"apps",
     {"core", "imaging", "meshing", "shaders", "tled", "simulation", "registration", "report", "study", "apps"}},
};

/// Files of meshing that belong to the mesher: they name it, its label field, its seeds or its fidelity.
bool is_mesher(const std::string& file) {
    static const std::regex names("mesher|label|voxel|seed|fidelity|refine|relaxation");
    return std::regex_search(file, names);
}

struct Include {
    std::string from, to, file;
};

std::vector<Include> includes() {
    std::vector<Include> found;
    const fs::path root = TISSUEWARP_SOURCE_DIR;
    const std::regex quoted(R"re(^\s*#include\s+"([a-z]+)/)re");
    for (const auto& [folder, allowed] : may_include)
        for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
            const std::string extension = entry.path().extension();
            if (extension != ".cpp" && extension != ".hpp") continue;
            std::ifstream file(entry.path());
            for (std::string line; std::getline(file, line);) {
                std::smatch match;
                if (std::regex_search(line, match, quoted))
                    found.push_back({folder, match[1], fs::relative(entry.path(), root).string()});
            }
        }
    return found;
}

TEST(Layers, IncludesRunOneWay) {
    const auto all = includes();
    ASSERT_GT(all.size(), 100u);
    for (const Include& include : all) {
        if (include.from == "meshing" && include.to == "imaging" && is_mesher(include.file)) continue;
        EXPECT_TRUE(may_include.at(include.from).contains(include.to))
            << include.file << " includes a header of " << include.to << "/";
    }
}

TEST(Layers, ThirdPartyImageAndMeshTypesStayOutOfHeaders) {
    const std::regex heavy(R"re(#include\s+[<"](itk|CGAL|nlopt|CLI|hdf5|H5|epoxy|GL/))re");
    for (const auto& [folder, allowed] : may_include)
        for (const auto& entry : fs::directory_iterator(fs::path(TISSUEWARP_SOURCE_DIR) / folder)) {
            if (entry.path().extension() != ".hpp" || folder == "apps") continue;
            std::ifstream file(entry.path());
            for (std::string line; std::getline(file, line);)
                EXPECT_FALSE(std::regex_search(line, heavy)) << entry.path() << ": " << line;
        }
}

}  // namespace
}  // namespace tissuewarp
