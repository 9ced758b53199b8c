// The subset of VTK's XML unstructured grids that holds tetrahedra and hexahedra: ascii, inline base64 and raw or
// base64 appended data, uncompressed, little-endian, one piece. The XML is scanned for tags; there is no general parser
// behind it.

#include "core/errors.hpp"
#include "meshing/detail/file_reader.hpp"
#include "meshing/mesh_io.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <optional>

namespace tissuewarp::meshing {

namespace {

using detail::FileReader;

struct Tag {
    std::string name;  ///< with a leading '/' on a closing tag
    std::map<std::string, std::string> attributes;
    bool empty = false;     ///< <tag/>
    std::size_t after = 0;  ///< position behind '>'
};

Tag parse_tag(const FileReader& file, std::size_t start, std::size_t end) {
    std::string_view body = file.text().substr(start + 1, end - start - 1);
    Tag tag;
    tag.after = end + 1;
    tag.empty = body.ends_with('/');
    if (tag.empty) body.remove_suffix(1);
    const std::size_t name_end = std::min(body.find_first_of(" \t\r\n"), body.size());
    tag.name = body.substr(0, name_end);
    for (std::size_t at = name_end; at < body.size();) {
        const std::size_t equals = body.find('=', at);
        if (equals == std::string_view::npos) break;
        const std::size_t open = body.find_first_of("\"'", equals);
        if (open == std::string_view::npos) file.fail("has an XML attribute without quotes");
        const std::size_t close = body.find(body[open], open + 1);
        if (close == std::string_view::npos) file.fail("has an XML attribute without a closing quote");
        std::string_view key = body.substr(at, equals - at);
        key.remove_prefix(std::min(key.find_first_not_of(" \t\r\n"), key.size()));
        key = key.substr(0, key.find_first_of(" \t\r\n"));
        tag.attributes[std::string(key)] = body.substr(open + 1, close - open - 1);
        at = close + 1;
    }
    return tag;
}

std::optional<Tag> next_tag(const FileReader& file, std::size_t from) {
    while (true) {
        const std::size_t start = file.text().find('<', from);
        if (start == std::string_view::npos) return std::nullopt;
        if (file.text().substr(start, 4) == "<!--") {
            from = file.text().find("-->", start);
            if (from == std::string_view::npos) return std::nullopt;
            continue;
        }
        const std::size_t end = file.text().find('>', start);
        if (end == std::string_view::npos) return std::nullopt;
        return parse_tag(file, start, end);
    }
}

/// Decodes base64 until a character outside the alphabet. Padding ends a group, not the stream: VTK encodes the length
/// and the data of one array as two streams in a row.
std::string decode_base64(std::string_view text, const FileReader& file) {
    std::string bytes;
    std::uint32_t bits = 0;
    int held = 0, padding = 0;
    for (char c : text) {
        int digit = 0;
        if (c >= 'A' && c <= 'Z')
            digit = c - 'A';
        else if (c >= 'a' && c <= 'z')
            digit = c - 'a' + 26;
        else if (c >= '0' && c <= '9')
            digit = c - '0' + 52;
        else if (c == '+')
            digit = 62;
        else if (c == '/')
            digit = 63;
        else if (c == '=')
            ++padding;
        else if (c == ' ' || c == '\n' || c == '\r' || c == '\t')
            continue;
        else
            break;
        bits = (bits << 6) | static_cast<std::uint32_t>(digit);
        if (++held < 4) continue;
        if (padding > 2) file.fail("has damaged base64 data");
        for (int byte = 0; byte < 3 - padding; ++byte) bytes += static_cast<char>(bits >> (16 - 8 * byte));
        bits = 0;
        held = padding = 0;
    }
    return bytes;
}

template <class T>
std::vector<double> decode_values(std::string_view bytes) {
    std::vector<double> values(bytes.size() / sizeof(T));
    for (std::size_t i = 0; i < values.size(); ++i) {
        T value;
        std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
        values[i] = static_cast<double>(value);
    }
    return values;
}

std::vector<double> decode_type(std::string_view bytes, const std::string& type, const FileReader& file) {
    if (type == "Float64") return decode_values<double>(bytes);
    if (type == "Float32") return decode_values<float>(bytes);
    if (type == "Int64") return decode_values<std::int64_t>(bytes);
    if (type == "UInt64") return decode_values<std::uint64_t>(bytes);
    if (type == "Int32") return decode_values<std::int32_t>(bytes);
    if (type == "UInt32") return decode_values<std::uint32_t>(bytes);
    if (type == "Int16") return decode_values<std::int16_t>(bytes);
    if (type == "UInt16") return decode_values<std::uint16_t>(bytes);
    if (type == "Int8") return decode_values<std::int8_t>(bytes);
    if (type == "UInt8") return decode_values<std::uint8_t>(bytes);
    file.fail("has an array of unknown type '" + type + "'");
}

/// What the file says about its arrays as a whole.
struct Layout {
    bool wide_header = false;  ///< UInt64 lengths instead of UInt32
    bool raw_appended = true;
    std::size_t appended = std::string_view::npos;  ///< position behind the underscore
};

/// Splits the length from the data that follow it.
std::string_view without_length(std::string_view bytes, const Layout& layout, const FileReader& file) {
    const std::size_t header = layout.wide_header ? 8 : 4;
    if (bytes.size() < header) file.fail("ends before its data do");
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data(), header);
    if (length > bytes.size() - header) file.fail("ends before its data do");
    return bytes.substr(header, length);
}

std::vector<double> read_ascii(std::string_view text, FileReader& file) {
    std::vector<double> values;
    const std::size_t end = static_cast<std::size_t>(text.data() - file.text().data()) + text.size();
    file.seek(end - text.size());
    while (true) {
        const std::string_view word = file.token();
        const std::size_t start = static_cast<std::size_t>(word.data() - file.text().data());
        if (word.empty() || start >= end) return values;
        values.push_back(file.to_number(word.substr(0, end - start)));
    }
}

std::vector<double> read_array(const Tag& tag, const Layout& layout, FileReader& file) {
    const auto attribute = [&](const char* key) {
        const auto found = tag.attributes.find(key);
        return found == tag.attributes.end() ? std::string() : found->second;
    };
    const std::string format = attribute("format");
    if (format == "appended") {
        const long long offset = file.to_integer(attribute("offset"));
        if (layout.appended == std::string_view::npos || offset < 0 ||
            static_cast<std::size_t>(offset) >= file.text().size() - layout.appended)
            file.fail("ends before its appended data do");
        const std::string_view rest = file.text().substr(layout.appended + static_cast<std::size_t>(offset));
        if (layout.raw_appended) return decode_type(without_length(rest, layout, file), attribute("type"), file);
        return decode_type(without_length(decode_base64(rest, file), layout, file), attribute("type"), file);
    }
    if (tag.empty) return {};
    const std::size_t end = file.text().find('<', tag.after);
    if (end == std::string_view::npos) file.fail("ends inside an array");
    const std::string_view content = file.text().substr(tag.after, end - tag.after);
    if (format == "binary")
        return decode_type(without_length(decode_base64(content, file), layout, file), attribute("type"), file);
    if (format != "ascii" && !format.empty()) file.fail("has an array of unknown format '" + format + "'");
    return read_ascii(content, file);
}

/// The arrays that make a mesh, by section and name.
struct Content {
    bool piece = false;
    std::size_t points = 0, cells = 0;
    std::map<std::string, std::vector<double>> arrays;
    std::vector<std::string> names;  ///< of all arrays of the file
};

void require_readable(const Tag& root, const FileReader& file) {
    const auto value = [&](const char* key) {
        const auto found = root.attributes.find(key);
        return found == root.attributes.end() ? std::string() : found->second;
    };
    if (value("type") != "UnstructuredGrid") file.fail("holds '" + value("type") + "'; an UnstructuredGrid is needed");
    if (value("byte_order") == "BigEndian") file.fail("is big-endian; write it little-endian");
    if (!value("compressor").empty()) file.fail("is compressed; write it without compression");
}

void locate_appended(const Tag& tag, Layout& layout, const FileReader& file) {
    const auto encoding = tag.attributes.find("encoding");
    layout.raw_appended = encoding == tag.attributes.end() || encoding->second == "raw";
    const std::size_t underscore = file.text().find('_', tag.after);
    if (underscore != std::string_view::npos) layout.appended = underscore + 1;
}

std::size_t piece_count(const Tag& tag, const char* key, const FileReader& file) {
    const auto found = tag.attributes.find(key);
    if (found == tag.attributes.end()) file.fail(std::string("has a piece without ") + key);
    return file.checked_count(file.to_integer(found->second), key, 1);
}

/// `more` names an array, by section and name, that is read besides those of the mesh.
Content read_content(FileReader& file, const std::string& more = {}) {
    Layout layout;
    Content content;
    std::vector<std::pair<std::string, Tag>> arrays;
    std::string section;
    bool root = false;
    for (auto tag = next_tag(file, 0); tag; tag = next_tag(file, tag->after)) {
        if (tag->name == "VTKFile") {
            require_readable(*tag, file);
            root = true;
            const auto header = tag->attributes.find("header_type");
            layout.wide_header = header != tag->attributes.end() && header->second == "UInt64";
        } else if (tag->name == "Piece") {
            if (content.piece) file.fail("has several pieces; merge them into one");
            content.piece = true;
            content.points = piece_count(*tag, "NumberOfPoints", file);
            content.cells = piece_count(*tag, "NumberOfCells", file);
        } else if (tag->name == "PointData" || tag->name == "CellData" || tag->name == "Points" ||
                   tag->name == "Cells") {
            section = tag->name;
        } else if (tag->name == "DataArray") {
            const auto name = tag->attributes.find("Name");
            const std::string key = name == tag->attributes.end() ? std::string() : name->second;
            arrays.emplace_back(section == "Points" ? "Points/" : section + "/" + key, *tag);
        } else if (tag->name == "AppendedData") {
            locate_appended(*tag, layout, file);
            break;
        }
    }
    if (!root || !content.piece) file.fail("is no VTK XML unstructured grid");
    for (const auto& [key, tag] : arrays) {
        content.names.push_back(key);
        if (key == "Points/" || key == "Cells/connectivity" || key == "Cells/types" || key == "Cells/offsets" ||
            key == "CellData/label" || key == more)
            content.arrays[key] = read_array(tag, layout, file);
    }
    return content;
}

const std::vector<double>& required(const Content& content, const char* key, std::size_t size, const FileReader& file) {
    const auto found = content.arrays.find(key);
    if (found == content.arrays.end()) file.fail(std::string("lacks the array ") + key);
    if (found->second.size() != size)
        file.fail(std::string("has ") + std::to_string(found->second.size()) + " values in " + key + "; " +
                  std::to_string(size) + " are needed");
    return found->second;
}

/// Files of other programs may follow the other orientation throughout; a mixture is damage and stays one.
void orient(TetMesh& mesh) {
    if (mesh.tet_count() > 0 && (tet_volumes(mesh).array() < 0.0).all()) mesh.tets.row(2).swap(mesh.tets.row(3));
}

int checked_integer(double value, int lowest, int highest, const char* what, const FileReader& file) {
    if (!(value >= lowest && value <= highest) || value != std::floor(value))
        file.refuse(std::string("has a ") + what + " of " + std::to_string(value) + "; it must be an integer from " +
                    std::to_string(lowest) + " to " + std::to_string(highest));
    return static_cast<int>(value);
}

enum class Accepted { Tetrahedra, TetrahedraAndHexahedra };

/// Corners of each cell by its VTK type, and in sum the size of the connectivity. Offsets must agree with them.
std::vector<int> cell_corners(const Content& content, Accepted accepted, const FileReader& file) {
    std::vector<int> corners;
    const auto& offsets = required(content, "Cells/offsets", content.cells, file);
    double end = 0.0;
    for (const double type : required(content, "Cells/types", content.cells, file)) {
        const bool hexahedron = type == 12.0 && accepted == Accepted::TetrahedraAndHexahedra;
        if (type != 10.0 && !hexahedron)
            file.refuse("has a cell of VTK type " + std::to_string(static_cast<int>(type)) +
                        (accepted == Accepted::Tetrahedra
                             ? "; only linear tetrahedra (10) are read"
                             : "; only linear tetrahedra (10) and hexahedra (12) are read"));
        end += hexahedron ? 8.0 : 4.0;
        if (offsets[corners.size()] != end) file.refuse("has cell offsets that do not count the corners of its cells");
        corners.push_back(hexahedron ? 8 : 4);
    }
    return corners;
}

MixedMesh read_cells(const std::filesystem::path& path, Accepted accepted) {
    FileReader file(path);
    const Content content = read_content(file);
    const std::vector<int> corners = cell_corners(content, accepted, file);
    const auto total = static_cast<std::size_t>(std::accumulate(corners.begin(), corners.end(), std::int64_t{0}));
    const auto hex_count = std::count(corners.begin(), corners.end(), 8);
    const auto& points = required(content, "Points/", 3 * content.points, file);
    const auto& nodes = required(content, "Cells/connectivity", total, file);
    const bool labelled = content.arrays.contains("CellData/label");
    if (labelled) required(content, "CellData/label", content.cells, file);

    MixedMesh result;
    TetMesh& mesh = result.mesh;
    HexCells& hexahedra = result.hexahedra;
    mesh.nodes = Eigen::Map<const Eigen::Matrix3Xd>(points.data(), 3, static_cast<Eigen::Index>(content.points));
    mesh.tets.resize(4, static_cast<Eigen::Index>(corners.size()) - hex_count);
    mesh.labels = Eigen::VectorXi::Ones(mesh.tets.cols());
    hexahedra.hexes.resize(8, hex_count);
    hexahedra.labels = Eigen::VectorXi::Ones(hex_count);
    int *tet = mesh.tets.data(), *hex = hexahedra.hexes.data(), *tet_label = mesh.labels.data(),
        *hex_label = hexahedra.labels.data();
    auto node = nodes.begin();
    for (std::size_t cell = 0; cell < corners.size(); ++cell) {
        int*& corner = corners[cell] == 8 ? hex : tet;
        for (int k = 0; k < corners[cell]; ++k)
            *corner++ = checked_integer(*node++, 0, mesh.node_count() - 1, "node index", file);
        int*& label = corners[cell] == 8 ? hex_label : tet_label;
        if (labelled)
            *label++ = checked_integer(content.arrays.at("CellData/label")[cell], 1, 2147483647, "label", file);
    }
    orient(mesh);
    const std::string name = path.string();
    if (hex_count > 0) require_valid(mesh.nodes, hexahedra, name.c_str());
    if (mesh.tet_count() > 0 || hex_count == 0) require_valid(mesh, name.c_str());
    return result;
}

}  // namespace

TetMesh read_vtu(const std::filesystem::path& path) {
    return read_cells(path, Accepted::Tetrahedra).mesh;
}

Eigen::MatrixXd read_vtu_cell_array(const std::filesystem::path& path, const std::string& name) {
    const std::string section = "CellData/", key = section + name;
    FileReader file(path);
    const Content content = read_content(file, key);
    const auto found = content.arrays.find(key);
    if (found == content.arrays.end()) {
        std::string names;
        for (const std::string& other : content.names)
            if (other.starts_with(section)) names += (names.empty() ? "'" : ", '") + other.substr(section.size()) + "'";
        file.refuse("has no cell array '" + name + "'" + (names.empty() ? "" : "; it has " + names));
    }
    const std::vector<double>& values = found->second;
    if (content.cells == 0 || values.empty() || values.size() % content.cells != 0)
        file.refuse("has " + std::to_string(values.size()) + " values in the cell array '" + name + "' of " +
                    std::to_string(content.cells) + " cells");
    const auto cells = static_cast<Eigen::Index>(content.cells);
    return Eigen::Map<const Eigen::MatrixXd>(values.data(), static_cast<Eigen::Index>(values.size()) / cells, cells);
}

MixedMesh read_mixed_vtu(const std::filesystem::path& path) {
    return read_cells(path, Accepted::TetrahedraAndHexahedra);
}

}  // namespace tissuewarp::meshing
