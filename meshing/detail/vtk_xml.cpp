#include "meshing/detail/vtk_xml.hpp"

#include "meshing/detail/vtk_encoding.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <optional>

namespace tissuewarp::meshing::detail {

namespace {

constexpr std::array sections{"FieldData", "PointData", "CellData", "Points", "Cells",
                              "Verts",     "Lines",     "Strips",   "Polys"};

XmlTag parse_tag(const FileReader& file, std::size_t start, std::size_t end) {
    std::string_view body = file.text().substr(start + 1, end - start - 1);
    XmlTag tag;
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

std::optional<XmlTag> next_tag(const FileReader& file, std::size_t from) {
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

template <class T>
std::vector<double> numbers(std::string_view bytes) {
    std::vector<double> values(bytes.size() / sizeof(T));
    for (std::size_t i = 0; i < values.size(); ++i) {
        T value;
        std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
        values[i] = static_cast<double>(value);
    }
    return values;
}

std::vector<double> numbers_of_type(std::string_view bytes, const std::string& type, const FileReader& file) {
    if (type == "Float64") return numbers<double>(bytes);
    if (type == "Float32") return numbers<float>(bytes);
    if (type == "Int64") return numbers<std::int64_t>(bytes);
    if (type == "UInt64") return numbers<std::uint64_t>(bytes);
    if (type == "Int32") return numbers<std::int32_t>(bytes);
    if (type == "UInt32") return numbers<std::uint32_t>(bytes);
    if (type == "Int16") return numbers<std::int16_t>(bytes);
    if (type == "UInt16") return numbers<std::uint16_t>(bytes);
    if (type == "Int8") return numbers<std::int8_t>(bytes);
    if (type == "UInt8" || type == "String") return numbers<std::uint8_t>(bytes);
    file.fail("has an array of unknown type '" + type + "'");
}

/// Between a tag and the next one.
std::string_view content_of(const XmlTag& tag, const FileReader& file) {
    if (tag.empty) return {};
    const std::size_t end = file.text().find('<', tag.after);
    if (end == std::string_view::npos) file.fail("ends inside an array");
    return file.text().substr(tag.after, end - tag.after);
}

std::vector<double> ascii_numbers(std::string_view text, FileReader& file) {
    std::vector<double> values;
    if (text.empty()) return values;
    const std::size_t end = static_cast<std::size_t>(text.data() - file.text().data()) + text.size();
    file.seek(end - text.size());
    while (true) {
        const std::string_view word = file.token();
        const std::size_t start = static_cast<std::size_t>(word.data() - file.text().data());
        if (word.empty() || start >= end) return values;
        values.push_back(file.to_number(word.substr(0, end - start)));
    }
}

}  // namespace

std::string XmlTag::attribute(const std::string& key) const {
    const auto found = attributes.find(key);
    return found == attributes.end() ? std::string() : found->second;
}

VtkXml::VtkXml(FileReader& file, const std::string& type) : file_(file) {
    bool root = false, piece = false;
    std::string section;
    for (auto tag = next_tag(file, 0); tag; tag = next_tag(file, tag->after)) {
        if (tag->name == "VTKFile") {
            take_root(*tag, type);
            root = true;
        } else if (tag->name == "Piece") {
            if (piece) file.fail("has several pieces; merge them into one");
            piece = true;
            piece_ = *tag;
        } else if (std::find(sections.begin(), sections.end(), tag->name) != sections.end()) {
            section = tag->name;
            sections_[section] = *tag;
        } else if (tag->name == "DataArray" || tag->name == "Array") {
            take_array(*tag, section);
        } else if (tag->name == "AppendedData") {
            take_appended(*tag);
            break;
        }
    }
    if (!root || !piece) file.fail("is no VTK XML file of type " + type);
}

void VtkXml::take_root(const XmlTag& tag, const std::string& type) {
    if (tag.attribute("type") != type)
        file_.fail("holds '" + tag.attribute("type") + "'; data of type " + type + " are needed");
    if (tag.attribute("byte_order") == "BigEndian") file_.fail("is big-endian; write it little-endian");
    if (tag.attribute("header_type") == "UInt64") header_bytes_ = 8;
    const std::string compressor = tag.attribute("compressor");
    compressed_ = !compressor.empty();
    if (compressed_ && compressor != "vtkZLibDataCompressor")
        file_.fail("is compressed by " + compressor + "; write it with vtkZLibDataCompressor or without compression");
}

void VtkXml::take_appended(const XmlTag& tag) {
    const std::string encoding = tag.attribute("encoding");
    raw_appended_ = encoding.empty() || encoding == "raw";
    const std::size_t underscore = file_.text().find('_', tag.after);
    if (underscore != std::string_view::npos) appended_ = underscore + 1;
}

void VtkXml::take_array(const XmlTag& tag, const std::string& section) {
    const std::string name = section == "Points" ? "Points/" : section + "/" + tag.attribute("Name");
    names_.push_back(name);
    arrays_[name] = tag;
}

std::size_t VtkXml::count(const std::string& attribute) const {
    const std::string text = piece_.attribute(attribute);
    if (text.empty()) return 0;
    const long long value = file_.to_integer(text);
    const std::size_t most = file_.text().size() * (compressed_ ? most_compression : 1);
    if (value < 0 || static_cast<std::size_t>(value) > most || value > 2147483647)
        file_.fail("announces " + text + " as " + attribute + ", more than the file can hold");
    return static_cast<std::size_t>(value);
}

std::string VtkXml::attribute(const std::string& section, const std::string& key) const {
    const auto found = sections_.find(section);
    return found == sections_.end() ? std::string() : found->second.attribute(key);
}

bool VtkXml::is_numeric(const std::string& name) const {
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) return false;
    const std::string type = found->second.attribute("type");
    return type.starts_with("Int") || type.starts_with("UInt") || type.starts_with("Float");
}

std::string VtkXml::bytes_of(const XmlTag& tag) const {
    VtkEncoded encoded{content_of(tag, file_), true, compressed_, header_bytes_};
    if (tag.attribute("format") == "appended") {
        const long long offset = file_.to_integer(tag.attribute("offset"));
        if (appended_ == std::string_view::npos || offset < 0 ||
            static_cast<std::size_t>(offset) >= file_.text().size() - appended_)
            file_.fail("ends before its appended data do");
        encoded.text = file_.text().substr(appended_ + static_cast<std::size_t>(offset));
        encoded.base64 = !raw_appended_;
    }
    return decoded(encoded, file_);
}

std::vector<double> VtkXml::values(const std::string& name) const {
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) file_.fail("lacks the array " + name);
    const XmlTag& tag = found->second;
    const std::string format = tag.attribute("format");
    if (format == "ascii" || format.empty()) return ascii_numbers(content_of(tag, file_), file_);
    if (format != "binary" && format != "appended") file_.fail("has an array of unknown format '" + format + "'");
    if (format == "binary" && tag.empty) return {};
    return numbers_of_type(bytes_of(tag), tag.attribute("type"), file_);
}

std::vector<double> VtkXml::values(const std::string& name, std::size_t size) const {
    std::vector<double> result = values(name);
    if (result.size() != size)
        file_.fail("has " + std::to_string(result.size()) + " values in " + name + "; " + std::to_string(size) +
                   " are needed");
    return result;
}

std::string VtkXml::text(const std::string& name) const {
    std::string result;
    if (!has(name)) return result;
    for (const double character : values(name)) {
        if (!(character > 0 && character < 128)) break;
        result += static_cast<char>(character);
    }
    return result;
}

}  // namespace tissuewarp::meshing::detail
