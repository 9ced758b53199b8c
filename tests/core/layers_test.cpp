/// The one direction of dependency: no folder includes a header of a folder that it may not know.
#include "tests/support/folders.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
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
    {"report", {"core", "imaging", "meshing", "report"}},
    {"study", {"core", "imaging", "meshing", "shaders", "tled", "registration", "report", "study"}},
    {"server", {"core", "imaging", "meshing", "tled", "registration", "server"}},
    {"apps",
     {"core", "imaging", "meshing", "shaders", "tled", "simulation", "registration", "report", "study", "server",
      "apps"}},
    {"python", {"core", "imaging", "meshing", "tled", "simulation", "registration", "apps", "python"}},  // scene files
};

/// The rooms of tled, and into which of the others each may look. All see the headers that lie directly in tled/.
const std::map<std::string, std::set<std::string>> rooms_of_tled{
    {"parallel", {}},
    {"material", {}},
    {"model", {"material", "parallel"}},
    {"cpu", {"material", "model", "parallel"}},
    {"gpu", {"material", "model", "parallel"}},
    {"stiffness", {"material", "model", "parallel"}},
    {"statics", {"model", "parallel", "stiffness"}},
    {"error", {"material", "model", "parallel", "stiffness"}},
    {"reference", {"material", "model", "parallel", "stiffness"}},
    {"render_pass", {"gpu", "parallel"}},
};

/// The same of registration, whose files lie lowest and whose terms know all that they are made of.
const std::map<std::string, std::set<std::string>> rooms_of_registration{
    {"boundary", {}},
    {"dial", {}},
    {"io", {}},
    {"springs", {}},
    {"evaluation", {"field", "io"}},
    {"field", {}},
    {"resection", {"boundary", "field", "matching"}},
    {"surroundings", {"field"}},
    {"matching", {"field", "springs"}},
    {"pose", {"boundary", "io"}},
    {"loads", {"pose", "springs"}},
    {"course", {"loads", "pose"}},
    {"terms", {"boundary", "evaluation", "io", "loads", "matching", "pose", "resection", "springs"}},
    {"uncertainty", {"field", "loads", "pose", "springs"}},
    {"stretch", {"boundary", "evaluation", "pose", "terms"}},
    {"prepared", {"boundary", "io", "loads", "matching", "terms"}},
};

/// Rooms that are targets of their own, for tests, studies and benchmarks.
const std::set<std::string> laboratory{"reference", "render_pass"};

/// What registration and simulation may know of tled's rooms, beside its public headers.
const std::set<std::string> known_to_products{"error", "model", "stiffness"};

/// Files of meshing that belong to the mesher: they name it, its label field, its seeds or its fidelity.
bool is_mesher(const std::string& file) {
    static const std::regex names("mesher|label|voxel|seed|fidelity|refine|relaxation");
    return std::regex_search(file, names);
}

struct Include {
    std::string from, to, file;
    std::string header;  ///< as it is written
};

/// "stiffness" of "tled/stiffness/lattice.hpp", nothing of "tled/engine.hpp", the outer one of a room in a room.
std::string room_of(const std::string& path) {
    const fs::path folder = fs::path(path).parent_path();
    return folder.has_parent_path() ? std::next(folder.begin())->string() : "";
}

std::vector<Include> includes() {
    std::vector<Include> found;
    const fs::path root = tissuewarp::test::source_folder();
    const std::regex quoted(R"re(^\s*#include\s+"(([a-z]+)/[^"]+)")re");
    for (const auto& [folder, allowed] : may_include)
        for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
            const std::string extension = entry.path().extension();
            if (extension != ".cpp" && extension != ".hpp") continue;
            std::ifstream file(entry.path());
            for (std::string line; std::getline(file, line);) {
                std::smatch match;
                if (std::regex_search(line, match, quoted))
                    found.push_back({folder, match[2], fs::relative(entry.path(), root).string(), match[1]});
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

void expect_one_way(const std::string& folder, const std::map<std::string, std::set<std::string>>& rooms) {
    std::set<std::string> seen;
    for (const Include& include : includes()) {
        if (include.to != folder || include.from != folder) continue;
        const std::string from = room_of(include.file), to = room_of(include.header);
        if (from.empty() || to.empty() || from == to) continue;
        seen.insert(from);
        ASSERT_TRUE(rooms.contains(from)) << include.file << " lies in a room that this test does not know";
        EXPECT_TRUE(rooms.at(from).contains(to)) << include.file << " includes " << include.header;
    }
    EXPECT_GT(seen.size(), 5u);
}

TEST(Layers, RoomsOfTledLookOneWay) {
    expect_one_way("tled", rooms_of_tled);
}

TEST(Layers, RoomsOfRegistrationLookOneWay) {
    expect_one_way("registration", rooms_of_registration);
}

// The method is one page, and no folder a hall.
TEST(Layers, FilesAndFoldersStaySmall) {
    const fs::path root = tissuewarp::test::source_folder();
    const auto lines = [](const fs::path& path) {
        std::ifstream file(path);
        return std::count(std::istreambuf_iterator<char>(file), {}, '\n');
    };
    EXPECT_LE(lines(root / "registration" / "register.cpp"), 150);
    for (const char* folder : {"registration", "tled"}) {
        std::map<std::string, int> files;
        for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
            if (!entry.is_regular_file()) continue;
            EXPECT_LE(lines(entry.path()), 400) << entry.path();
            ++files[entry.path().parent_path().string()];
        }
        for (const auto& [name, count] : files) EXPECT_LE(count, 40) << name;
    }
}

/// Data members of a class whose body begins at `body`, those of classes within it left out: names that end in "_".
int members_of(const std::string& text, std::size_t body) {
    static const std::regex member(R"(\b\w+_(?=\s*[;,={]))");
    int count = 0, depth = 0;
    std::string statement;
    for (std::size_t at = body; at < text.size() && depth >= 0; ++at) {
        const char c = text[at];
        if (c == '{') ++depth;
        if (c == '}') --depth;
        if (depth > 0 || c == '}') continue;
        statement += c;
        if (c != ';') continue;
        if (statement.find('(') == std::string::npos)
            count +=
                static_cast<int>(std::distance(std::sregex_iterator(statement.begin(), statement.end(), member), {}));
        statement.clear();
    }
    return count;
}

TEST(Layers, ClassesOfRegistrationHoldFewThings) {
    static const std::regex begin(R"(\nclass \w[^;{]*\{)"), remark(R"(//[^\n]*)");
    int seen = 0, most = 0;
    for (const auto& entry : fs::recursive_directory_iterator(tissuewarp::test::source_folder() / "registration")) {
        if (entry.path().extension() != ".hpp" && entry.path().extension() != ".cpp") continue;
        std::ifstream file(entry.path());
        std::string text(std::istreambuf_iterator<char>(file), {});
        text = std::regex_replace(text, remark, "");
        for (std::sregex_iterator at(text.begin(), text.end(), begin), end; at != end; ++at, ++seen) {
            const int members = members_of(text, static_cast<std::size_t>(at->position() + at->length()));
            most = std::max(most, members);
            EXPECT_LE(members, 12) << entry.path() << at->str();
        }
    }
    EXPECT_GT(seen, 30);
    EXPECT_GT(most, 9);
}

// Equilibria are sought by means of a RestStiffness of the caller's: the one room that a public header opens.
TEST(Layers, PublicHeadersOfTledIncludeNoRoom) {
    for (const Include& include : includes()) {
        const bool is_public = include.from == "tled" && room_of(include.file).empty();
        if (!is_public || include.to != "tled" || room_of(include.header).empty()) continue;
        if (include.file.ends_with(".cpp"))
            EXPECT_FALSE(laboratory.contains(room_of(include.header))) << include.file << ": " << include.header;
        else
            EXPECT_EQ(include.file + ": " + include.header, "tled/equilibrium.hpp: tled/stiffness/rest_stiffness.hpp");
    }
}

TEST(Layers, ProductsKnowFewRoomsOfTled) {
    for (const Include& include : includes()) {
        if ((include.from != "registration" && include.from != "simulation") || include.to != "tled") continue;
        const std::string room = room_of(include.header);
        EXPECT_TRUE(room.empty() || known_to_products.contains(room)) << include.file << " includes " << include.header;
    }
}

TEST(Layers, ThirdPartyImageAndMeshTypesStayOutOfHeaders) {
    const std::regex heavy(R"re(#include\s+[<"](itk|CGAL|nlopt|CLI|hdf5|H5|epoxy|GL/))re");
    for (const auto& [folder, allowed] : may_include)
        for (const auto& entry : fs::directory_iterator(tissuewarp::test::source_folder() / folder)) {
            if (entry.path().extension() != ".hpp" || folder == "apps") continue;
            std::ifstream file(entry.path());
            for (std::string line; std::getline(file, line);)
                EXPECT_FALSE(std::regex_search(line, heavy)) << entry.path() << ": " << line;
        }
}

}  // namespace
}  // namespace tissuewarp
