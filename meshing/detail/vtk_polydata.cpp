// VTK legacy polydata, ascii and binary (big-endian), up to version 5.1, whose cells are offsets and connectivity.

#include "meshing/detail/surface_formats.hpp"

#include <cctype>
#include <map>

namespace tissuewarp::meshing::detail {

namespace {

class PolydataReader {
public:
    explicit PolydataReader(FileReader& file) : file_(file) {}

    RawSurface read() {
        if (!file_.line().starts_with("# vtk DataFile")) file_.fail("is no VTK legacy file");
        surface_.take_free_text(file_.line());  // the title, as 3D Slicer writes it
        const std::string encoding = keyword();
        if (encoding != "ASCII" && encoding != "BINARY") file_.fail("is neither ASCII nor BINARY");
        binary_ = encoding == "BINARY";
        if (keyword() != "DATASET" || keyword() != "POLYDATA")
            file_.fail("holds no POLYDATA; write the surface as polydata");
        while (section()) {
        }
        return std::move(surface_);
    }

private:
    /// The next word in capitals: files may be written in either.
    std::string keyword() {
        std::string word(file_.token());
        for (char& c : word) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
        return word;
    }

    bool section() {
        const std::string name = keyword();
        if (name.empty()) return false;
        if (name == "POINTS") {
            const long long count = file_.integer();
            read_vectors(count, surface_.nodes);
        } else if (name == "POLYGONS") {
            for (const auto& polygon : read_cells()) surface_.add_polygon(polygon);
        } else if (name == "LINES") {
            surface_.lines = read_cells();
        } else if (name == "VERTICES") {
            read_cells();
        } else if (name == "TRIANGLE_STRIPS") {
            file_.fail("has triangle strips; write triangles");
        } else if (name == "METADATA") {
            skip_metadata();
        } else if (name == "FIELD") {
            read_field();
        } else if (name == "POINT_DATA") {
            file_.integer();
            const std::size_t start = file_.position();
            if (keyword() != "NORMALS") {
                file_.seek(start);
                return false;  // other attributes are of no use here
            }
            file_.token();  // name
            read_vectors(static_cast<long long>(surface_.nodes.size()), surface_.normals);
            return false;
        } else if (name == "CELL_DATA") {
            return false;
        } else {
            file_.fail("has the section '" + name.substr(0, 40) +
                       "'; points, polygons, lines, fields and data of points are read");
        }
        return true;
    }

    /// Up to an empty line.
    void skip_metadata() {
        file_.line();
        while (file_.remaining() > 0 && !file_.line().empty()) {
        }
    }

    /// Arrays that may stand before, between and behind the other sections; only one that names the frame is of use.
    void read_field() {
        file_.token();  // name
        const std::size_t arrays = file_.count("arrays", 4);
        for (std::size_t a = 0; a < arrays; ++a) {
            std::string name(file_.token());
            while (name == "METADATA") {  // of the array before
                skip_metadata();
                name = file_.token();
            }
            const long long components = file_.integer(), tuples = file_.integer();
            const std::string type(file_.token());
            file_.line();
            const std::size_t values =
                file_.checked_count(components, "components", 1) * file_.checked_count(tuples, "tuples", 1);
            if (type == "string" || type == "utf8_string") {
                (void)file_.checked_count(static_cast<long long>(values), "texts", 1);
                for (std::size_t v = 0; v < values; ++v) {
                    const std::string_view text = read_text();
                    if (name == "SPACE" && surface_.space.empty())
                        surface_.space = space_in("SPACE=" + std::string(text));
                }
            } else {
                skip_values(static_cast<long long>(values), type);
            }
        }
    }

    /// In binary files the two highest bits of the first byte say how many bytes hold the length.
    std::string_view read_text() {
        if (!binary_) return file_.line();
        const auto first = file_.binary<std::uint8_t>();
        std::size_t length = first & 0x3fU;
        for (int more = (1 << (3 - (first >> 6U))) - 1; more > 0; --more)
            length = length << 8U | file_.binary<std::uint8_t>();
        const std::size_t start = file_.position();
        file_.skip(length);
        return file_.text().substr(start, length);
    }

    void skip_values(long long count, const std::string& type) {
        static const std::map<std::string, std::size_t> bytes{
            {"char", 1},         {"unsigned_char", 1}, {"short", 2},     {"unsigned_short", 2},
            {"int", 4},          {"unsigned_int", 4},  {"long", 8},      {"unsigned_long", 8},
            {"vtktypeint64", 8}, {"vtktypeuint64", 8}, {"vtkIdType", 4}, {"float", 4},
            {"double", 8}};
        const auto size = bytes.find(type);
        if (size == bytes.end()) file_.fail("has a field of type '" + type + "'; write it without");
        file_.checked_count(count, "values", binary_ ? size->second : 2);
        if (binary_) return file_.skip(static_cast<std::size_t>(count) * size->second);
        for (long long v = 0; v < count; ++v) file_.number();
    }

    double value(const std::string& type) {
        if (!binary_) return file_.number();
        if (type == "float") return file_.binary<float>(true);
        if (type == "double") return file_.binary<double>(true);
        file_.fail("has values of type '" + type + "'; float and double are read");
    }

    void read_vectors(long long announced, std::vector<Eigen::Vector3d>& vectors) {
        const std::string type(file_.token());
        file_.line();
        vectors.resize(file_.checked_count(announced, "points", binary_ ? 12 : 6));
        for (Eigen::Vector3d& vector : vectors)
            for (double& x : vector) x = value(type);
    }

    long long index(const std::string& type) {
        if (!binary_) return file_.integer();
        if (type == "vtktypeint64") return file_.binary<std::int64_t>(true);
        return file_.binary<std::int32_t>(true);
    }

    std::vector<long long> read_indices(long long announced, const std::string& type) {
        std::vector<long long> indices(file_.checked_count(announced, "indices", binary_ ? 4 : 2));
        for (long long& entry : indices) entry = index(type);
        return indices;
    }

    std::vector<std::vector<long long>> read_cells() {
        const long long first = file_.integer(), second = file_.integer();
        file_.line();
        const std::size_t start = file_.position();
        if (keyword() == "OFFSETS") return read_offset_cells(first, second);
        file_.seek(start);
        std::vector<std::vector<long long>> cells(file_.checked_count(first, "cells", binary_ ? 4 : 2));
        for (auto& cell : cells) cell = read_indices(index("int"), "int");
        return cells;
    }

    std::vector<std::vector<long long>> read_offset_cells(long long offset_count, long long index_count) {
        std::string type(file_.token());
        file_.line();
        const auto offsets = read_indices(offset_count, type);
        if (keyword() != "CONNECTIVITY") file_.fail("has OFFSETS without CONNECTIVITY");
        type = file_.token();
        file_.line();
        const auto indices = read_indices(index_count, type);
        std::vector<std::vector<long long>> cells;
        for (std::size_t c = 1; c < offsets.size(); ++c) {
            if (offsets[c - 1] < 0 || offsets[c] < offsets[c - 1] || offsets[c] > index_count)
                file_.fail("has cell offsets that leave the connectivity");
            cells.emplace_back(indices.begin() + offsets[c - 1], indices.begin() + offsets[c]);
        }
        return cells;
    }

    FileReader& file_;
    RawSurface surface_;
    bool binary_ = false;
};

}  // namespace

RawSurface read_vtk_polydata(FileReader& file) {
    return PolydataReader(file).read();
}

}  // namespace tissuewarp::meshing::detail
