#include "imaging/detail/text_headers.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>

namespace tissuewarp::imaging::detail {

namespace {

constexpr std::size_t longest_header = 1 << 20;  // 1 MiB of text: garbage without line ends must stop somewhere

std::string trimmed(const std::string& text) {
    const auto first = text.find_first_not_of(" \t\r\n");
    if (first == std::string::npos) return "";
    return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

std::string lower_case(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

std::string head_of(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw IoError("cannot open '" + path.string() + "'; check the path and its rights");
    std::string head(longest_header, '\0');
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(file.gcount()));
    return head;
}

}  // namespace

std::string TextHeader::value(const std::string& key) const {
    const auto found = fields.find(key);
    return found == fields.end() ? "" : found->second;
}

TextHeader read_nrrd_header(const std::filesystem::path& path) {
    const std::string head = head_of(path);
    if (head.compare(0, 4, "NRRD") != 0)
        throw IoError("cannot read '" + path.string() + "': it does not begin with 'NRRD'; give an NRRD file");
    TextHeader header;
    std::size_t begin = 0;
    while (begin < head.size()) {
        const std::size_t end = std::min(head.find('\n', begin), head.size());
        const std::string line = trimmed(head.substr(begin, end - begin));
        begin = end + 1;
        header.bytes = std::min(begin, head.size());
        if (line.empty()) break;
        const std::size_t colon = line.find(':');
        if (line[0] == '#' || colon == std::string::npos) continue;
        // "key:=value" is a free comment pair; "key: value" is a field of the format.
        if (line.compare(colon, 2, ":=") == 0) continue;
        header.fields[lower_case(trimmed(line.substr(0, colon)))] = trimmed(line.substr(colon + 1));
    }
    return header;
}

TextHeader read_meta_header(const std::filesystem::path& path) {
    const std::string head = head_of(path);
    TextHeader header;
    std::size_t begin = 0;
    while (begin < head.size()) {
        const std::size_t end = std::min(head.find('\n', begin), head.size());
        const std::string line = head.substr(begin, end - begin);
        begin = end + 1;
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) break;
        const std::string key = lower_case(trimmed(line.substr(0, equals)));
        header.fields[key] = trimmed(line.substr(equals + 1));
        if (key != "elementdatafile") continue;
        header.bytes = std::min(begin, head.size());
        return header;
    }
    throw IoError("cannot read '" + path.string() +
                  "': its header has no line 'ElementDataFile'; give a MetaImage file, whole");
}

std::vector<double> numbers_in(std::string text) {
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
    std::istringstream words(text);
    std::vector<double> numbers;
    for (std::string word; words >> word;) {
        char* end = nullptr;
        const double number = std::strtod(word.c_str(), &end);
        numbers.push_back(*end == '\0' ? number : std::numeric_limits<double>::quiet_NaN());
    }
    return numbers;
}

}  // namespace tissuewarp::imaging::detail
