/// XML polydata, as VTK's own writer makes it in every way that it knows (write_vtp.py), and damaged.
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "scratch_folder.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <utility>
#include <vector>

namespace tissuewarp::meshing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const fs::path samples = tissuewarp::test::source_folder() / "tests/meshing/vtp";

class Vtp : public ScratchFolder {
protected:
    static std::string complaint(const fs::path& path) {
        try {
            read_polylines(path);
        } catch (const Error& problem) {
            return problem.what();
        }
        return "";
    }
    [[nodiscard]] std::string complaint(const std::string& content) const {
        return complaint(file("bad.vtp", content));
    }
};

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// Two lines over four points, one of them on none, in the order of VTK's writer.
std::string two_lines(const std::string& points = "0 0 0  1 0 0  0 2 0  7 7 7", const std::string& nodes = "0 1 2 1 2",
                      const std::string& offsets = "3 5") {
    return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
           "<PolyData>\n<Piece NumberOfPoints=\"4\" NumberOfVerts=\"0\" NumberOfLines=\"2\" NumberOfStrips=\"0\" "
           "NumberOfPolys=\"0\">\n<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">" +
           points +
           "</DataArray></Points>\n<Lines>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">" + nodes +
           "</DataArray>\n<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">" + offsets +
           "</DataArray>\n</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n";
}

std::vector<fs::path> readable_samples() {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::directory_iterator(samples))
        if (entry.path().stem() != "lz4" && entry.path().stem() != "ras") paths.push_back(entry.path());
    return paths;
}

TEST_F(Vtp, ReadsWhatVtkWritesInEveryWay) {
    const std::vector<fs::path> paths = readable_samples();
    ASSERT_EQ(paths.size(), 13u);
    Eigen::Matrix3Xd nodes(3, 6);
    nodes << 0, 5, 10, 5, 10, 0, 0, 0, 0.25, 5, 10, 5, 0, 0, 0, 0, -0.125, 0;
    for (const fs::path& path : paths) {
        const Surface surface = read_surface(path);
        EXPECT_EQ(surface.mesh.nodes, nodes) << path;
        ASSERT_EQ(surface.mesh.triangle_count(), 2) << path;
        EXPECT_EQ(surface.mesh.triangles.col(1), Eigen::Vector3i(0, 3, 5)) << path;
        ASSERT_EQ(surface.normals.cols(), 6) << path;
        EXPECT_EQ(surface.normals.col(4), Eigen::Vector3d::UnitZ()) << path;
        const Polylines lines = read_polylines(path);
        EXPECT_EQ(lines.nodes, nodes) << path;
        EXPECT_EQ(lines.lines, (std::vector<std::vector<int>>{{0, 1, 2}, {2, 4}})) << path;
    }
}

TEST_F(Vtp, RefusesWithARemedyWhatItDoesNotRead) {
    EXPECT_THAT(complaint(samples / "lz4.vtp"), ::testing::AllOf(HasSubstr("lz4.vtp"), HasSubstr("vtkLZ4"),
                                                                 HasSubstr("vtkZLibDataCompressor or without")));
    EXPECT_THAT(complaint(replaced(two_lines(), "Little", "Big")), HasSubstr("write it little-endian"));
    EXPECT_THAT(complaint(replaced(two_lines(), "type=\"PolyData\"", "type=\"ImageData\"")), HasSubstr("PolyData"));
    EXPECT_THAT(complaint(replaced(two_lines(), "NumberOfStrips=\"0\"", "NumberOfStrips=\"1\"")),
                HasSubstr("write triangles"));
    EXPECT_THAT(complaint(replaced(two_lines(), "</Piece>", "</Piece><Piece NumberOfPoints=\"1\"></Piece>")),
                HasSubstr("merge them"));
    EXPECT_THAT(complaint(fs::path("absent.vtp")), HasSubstr("absent.vtp"));
}

TEST_F(Vtp, RefusesHostileTexts) {
    ASSERT_EQ(complaint(two_lines()), "");
    EXPECT_EQ(read_polylines(file("good.vtp", two_lines())).lines.size(), 2u);
    const std::string points = "0 0 0  1 0 0  0 2 0  7 7 7", nodes = "0 1 2 1 2";
    const std::vector<std::pair<std::string, std::string>> bad{
        {"", "is no VTK XML file"},
        {"<VTKFile type=\"PolyData\"><PolyData/></VTKFile>", "is no VTK XML file"},
        {replaced(two_lines(), "NumberOfPoints=\"4\"", "NumberOfPoints=\"99999999999999999999\""),
         "99999999999999999999"},
        {replaced(two_lines(), "NumberOfPoints=\"4\"", "NumberOfPoints=\"2000000000\""), "more than the file can hold"},
        {replaced(two_lines(), "NumberOfPoints=\"4\"", "NumberOfPoints=\"-4\""), "announces -4 as NumberOfPoints"},
        {replaced(two_lines(), "NumberOfPoints=\"4\"", "NumberOfPoints=\"5\""), "12 values in Points/; 15 are needed"},
        {replaced(two_lines(), "NumberOfLines=\"2\"", "NumberOfLines=\"3\""), "2 values in Lines/offsets; 3"},
        {replaced(two_lines(), "Name=\"offsets\"", "Name=\"ends\""), "lacks the array Lines/offsets"},
        {replaced(two_lines(), "Float64\" NumberOfComponents=\"3\" format=\"ascii", "Float64\" format=\"hex"), "'hex'"},
        {two_lines("nan 0 0  1 0 0  0 2 0  7 7 7"), "not finite at point 0"},
        {two_lines("0 0 0  1 0 0  0 2 0  7 7 1e999"), "1e999"},
        {two_lines("0 0 0  1 0 0  0 2 0  7 7 x"), "'x'"},
        {two_lines(points, "0 1 2 1 4"), "uses point 4; it has points 0 to 3"},
        {two_lines(points, "0 1 2 1 -1"), "uses point -1"},
        {two_lines(points, "0 1 2 1 1.5"), "1.5"},
        {two_lines(points, "0 1 2 1 1e300"), "where an integer is needed"},
        {two_lines(points, nodes, "3 6"), "cell offset 6 in Lines/offsets after 3"},
        {two_lines(points, nodes, "5 3"), "cell offset 3 in Lines/offsets after 5"},
        {two_lines(points, nodes, "-1 5"), "cell offset -1"},
        {two_lines(points, nodes, "1 5"), "fewer than two points"},
    };
    for (const auto& [content, words] : bad)
        EXPECT_THAT(complaint(content), ::testing::AllOf(HasSubstr("bad.vtp"), HasSubstr(words))) << content;
}

TEST_F(Vtp, EveryTruncationIsAnErrorThatNamesTheFile) {
    for (const fs::path& path : readable_samples()) {
        const std::string whole = bytes_of(path);
        // Behind the last array that is read, a file may be cut and say all the same.
        const std::size_t end = std::min(whole.find("<Strips"), whole.find("<AppendedData"));
        for (std::size_t length = 0; length < end; length += 7)
            ASSERT_THAT(complaint(file("cut.vtp", whole.substr(0, length))), HasSubstr("cut.vtp"))
                << path << " cut to " << length;
    }
}

TEST_F(Vtp, EveryTruncationOfRawDataIsAnError) {
    write_surface(boundary_surface(box_mesh({3, 2, 1}, {3, 2, 2})).surface, file("box.vtp"));
    const std::string whole = bytes_of(file("box.vtp"));
    const std::size_t end = whole.rfind("\n</AppendedData>");
    for (std::size_t length = 0; length < end; length += 31)
        ASSERT_THROW(read_surface(file("cut.vtp", whole.substr(0, length))), Error) << "cut to " << length;
}

/// Every byte from `begin` on becomes 0xff by turns, and zero: nothing may happen but an error or another number.
void damage(const std::string& whole, std::size_t begin, const std::function<fs::path(const std::string&)>& written) {
    for (std::size_t at = begin; at < whole.size(); ++at)
        for (const char value : {'\xff', '\0'}) {
            std::string bad = whole;
            bad[at] = value;
            try {
                read_polylines(written(bad));
            } catch (const Error& problem) {
                ASSERT_THAT(problem.what(), HasSubstr("bad.vtp"));
            }
        }
}

TEST_F(Vtp, DamagedDataAreErrorsOrOtherNumbers) {
    for (const char* name : {"raw-none-64.vtp", "raw-zlib-32.vtp", "raw-zlib-64.vtp", "base64-zlib-32.vtp"}) {
        const std::string whole = bytes_of(samples / name);
        damage(whole, whole.find("<AppendedData"), [&](const std::string& bad) { return file("bad.vtp", bad); });
    }
}

TEST_F(Vtp, HugeLengthsAndOffsetsAreErrors) {
    for (const char* name : {"raw-none-64.vtp", "raw-zlib-64.vtp"}) {
        const std::string whole = bytes_of(samples / name);
        const std::size_t section = whole.find("<Points>"), offset = whole.find("offset=\"", section) + 8,
                          digits = whole.find('"', offset) - offset;
        for (const char* text : {"18446744073709551615", "9223372036854775807", "-1", "100000"})
            EXPECT_THAT(complaint(std::string(whole).replace(offset, digits, text)), HasSubstr("bad.vtp")) << text;
        const std::size_t points =
            whole.find('_', whole.find("<AppendedData")) + 1 + std::stoul(whole.substr(offset, digits));
        for (std::size_t word = 0; word < (name == std::string("raw-none-64.vtp") ? 1 : 4); ++word)
            for (const char* bytes : {"\xff\xff\xff\xff\xff\xff\xff\xff", "\xff\xff\xff\x0f\0\0\0\0"})
                EXPECT_THAT(complaint(std::string(whole).replace(points + 8 * word, 8, bytes, 8)), HasSubstr("bad.vtp"))
                    << name << ", length " << word;
    }
}

}  // namespace
}  // namespace tissuewarp::meshing
