// Polygon file format (Turk 1994): ascii and binary, both byte orders.

#include "meshing/detail/surface_formats.hpp"

namespace tissuewarp::meshing::detail {

namespace {

enum class Encoding { Ascii, LittleEndian, BigEndian };

struct Property {
    std::string name, type, count_type;  ///< count_type is empty for scalars
};

struct Element {
    std::string name;
    long long count = 0;
    std::vector<Property> properties;
};

struct Header {
    Encoding encoding = Encoding::Ascii;
    std::vector<Element> elements;
};

void read_property(FileReader& file, Header& header) {
    if (header.elements.empty()) file.fail("has a property before any element");
    Property property;
    property.type = file.token();
    if (property.type == "list") {
        property.count_type = file.token();
        property.type = file.token();
    }
    property.name = file.token();
    header.elements.back().properties.push_back(property);
}

Header read_header(FileReader& file) {
    Header header;
    if (file.line() != "ply") file.fail("is no PLY file");
    while (true) {
        const std::string_view keyword = file.token();
        if (keyword.empty()) file.fail("ends inside its header");
        if (keyword == "format") {
            const std::string_view format = file.token();
            if (format == "ascii")
                header.encoding = Encoding::Ascii;
            else if (format == "binary_little_endian")
                header.encoding = Encoding::LittleEndian;
            else if (format == "binary_big_endian")
                header.encoding = Encoding::BigEndian;
            else
                file.fail("has the unknown PLY format '" + std::string(format) + "'");
        } else if (keyword == "element") {
            Element element;
            element.name = file.token();
            element.count = file.integer();
            header.elements.push_back(element);
        } else if (keyword == "property") {
            read_property(file, header);
        }
        file.line();
        if (keyword == "end_header") return header;
    }
}

double read_value(FileReader& file, const std::string& type, Encoding encoding) {
    if (encoding == Encoding::Ascii) return file.number();
    const bool big = encoding == Encoding::BigEndian;
    if (type == "float" || type == "float32") return file.binary<float>(big);
    if (type == "double" || type == "float64") return file.binary<double>(big);
    if (type == "char" || type == "int8") return file.binary<std::int8_t>();
    if (type == "uchar" || type == "uint8") return file.binary<std::uint8_t>();
    if (type == "short" || type == "int16") return file.binary<std::int16_t>(big);
    if (type == "ushort" || type == "uint16") return file.binary<std::uint16_t>(big);
    if (type == "int" || type == "int32") return file.binary<std::int32_t>(big);
    if (type == "uint" || type == "uint32") return file.binary<std::uint32_t>(big);
    file.fail("has a property of unknown type '" + type + "'");
}

long long read_index(FileReader& file, const std::string& type, Encoding encoding) {
    const double value = read_value(file, type, encoding);
    if (!(value >= -1.0 && value < 9e15)) file.refuse("has a node index of " + std::to_string(value));
    return static_cast<long long>(value);
}

bool has(const Element& element, const char* name) {
    for (const Property& property : element.properties)
        if (property.name == name && property.count_type.empty()) return true;
    return false;
}

void read_element(FileReader& file, const Element& element, Encoding encoding, RawSurface& surface) {
    const bool vertex = element.name == "vertex", face = element.name == "face";
    if (vertex && !(has(element, "x") && has(element, "y") && has(element, "z")))
        file.fail("has vertices without x, y and z");
    const bool normals = vertex && has(element, "nx") && has(element, "ny") && has(element, "nz");
    if (element.properties.empty()) return;
    const std::size_t count = file.checked_count(element.count, element.name + " elements", 1);
    std::vector<long long> list;
    for (std::size_t row = 0; row < count; ++row) {
        Eigen::Vector3d position = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
        for (const Property& property : element.properties) {
            if (!property.count_type.empty()) {
                const long long size = read_index(file, property.count_type, encoding);
                list.resize(file.checked_count(size, "list entries", 1));
                const bool corners = face && property.name.starts_with("vertex_ind");
                for (long long& entry : list) {
                    if (corners)
                        entry = read_index(file, property.type, encoding);
                    else
                        read_value(file, property.type, encoding);
                }
                if (corners) surface.add_polygon(list);
                continue;
            }
            const double value = read_value(file, property.type, encoding);
            const char axis = property.name.back();
            if (axis < 'x' || axis > 'z') continue;
            if (property.name.size() == 1)
                position[axis - 'x'] = value;
            else if (property.name.size() == 2 && property.name[0] == 'n')
                normal[axis - 'x'] = value;
        }
        if (vertex) surface.nodes.push_back(position);
        if (normals) surface.normals.push_back(normal);
    }
}

/// Of the header, behind which the cursor stands and stays.
void take_comments(FileReader& file, RawSurface& surface) {
    const std::size_t end = file.position();
    file.seek(0);
    while (file.position() < end)
        if (const std::string_view line = file.line(); line.starts_with("comment") || line.starts_with("obj_info"))
            surface.take_free_text(line);
    file.seek(end);
}

}  // namespace

RawSurface read_ply(FileReader& file) {
    RawSurface surface;
    const Header header = read_header(file);
    take_comments(file, surface);
    for (const Element& element : header.elements) read_element(file, element, header.encoding, surface);
    return surface;
}

}  // namespace tissuewarp::meshing::detail
