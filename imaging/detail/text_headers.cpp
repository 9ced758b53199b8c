#include "imaging/detail/text_headers.hpp"

#include "core/errors.hpp"
#include "imaging/detail/header_checks.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>

namespace tissuewarp::imaging::detail {

namespace {

// 1 MiB of text: garbage without line ends must stop somewhere. Sweeps have some kB for each frame.
constexpr std::size_t longest_header = 1 << 20, longest_header_of_sweep = 1 << 26;
constexpr std::string_view frame_prefix = "Seq_Frame";

/// The first lines of a file, one after the other.
class HeadLines {
public:
    explicit HeadLines(const std::filesystem::path& path, std::size_t longest = longest_header) {
        std::error_code failure;
        const auto whole = std::filesystem::file_size(path, failure);
        head_.resize(failure ? longest : static_cast<std::size_t>(std::min<std::uintmax_t>(longest, whole)));
        std::ifstream file(path, std::ios::binary);
        if (!file) throw IoError("cannot open '" + path.string() + "'; check the path and its rights");
        file.read(head_.data(), static_cast<std::streamsize>(head_.size()));
        head_.resize(static_cast<std::size_t>(file.gcount()));
    }
    [[nodiscard]] const std::string& text() const { return head_; }
    /// Bytes of the lines that were taken.
    [[nodiscard]] std::size_t taken() const { return std::min(begin_, head_.size()); }
    bool next(std::string& line) {
        if (begin_ >= head_.size()) return false;
        const std::size_t end = std::min(head_.find('\n', begin_), head_.size());
        line = trimmed(head_.substr(begin_, end - begin_));
        begin_ = end + 1;
        return true;
    }
    /// The lines that remain, without empty ones.
    std::vector<std::string> rest() {
        std::vector<std::string> lines;
        for (std::string line; next(line);)
            if (!line.empty()) lines.push_back(line);
        return lines;
    }

private:
    std::string head_;
    std::size_t begin_ = 0;
};

bool is_list(const std::string& value) {
    const std::string word = lower_case(value.substr(0, value.find_first_of(" \t")));
    return word == "list";
}

/// A printf pattern of one whole number, "slice%03d.raw" for instance: nothing else is handed to printf.
bool is_pattern(const std::string& word) {
    const auto percent = word.find('%');
    if (percent == std::string::npos || word.find('%', percent + 1) != std::string::npos) return false;
    auto end = word.find_first_not_of("0123456789", percent + 1);
    return end != std::string::npos && end - percent <= 3 && (word[end] == 'd' || word[end] == 'i' || word[end] == 'u');
}

/// "pattern [first [last [step]]]", counted inclusively as both formats do.
std::vector<std::string> names_of_pattern(const std::filesystem::path& path, const std::string& value,
                                          std::size_t slices, std::size_t most) {
    std::istringstream words(value);
    std::string pattern;
    words >> pattern;
    if (!is_pattern(pattern))
        throw unusable(path, "'" + pattern +
                                 "' is no pattern of file names with one number (such as slice%03d.raw); "
                                 "correct the header");
    long long first = 1, last = 0, step = 1;
    const auto too_large = [](long long number) {
        return number > std::numeric_limits<int>::max() || number < std::numeric_limits<int>::min();
    };
    words >> first;
    if (!(words >> last)) last = too_large(first) ? first : first + static_cast<long long>(slices) - 1;
    words.clear();
    if (!(words >> step)) step = last < first ? -1 : 1;
    const auto most_files = static_cast<long long>(most);
    if (too_large(first) || too_large(last) || too_large(step) || step == 0 || (last - first) / step < 0 ||
        (last - first) / step >= most_files)
        throw unusable(path, "the file names '" + value + "' count from " + std::to_string(first) + " to " +
                                 std::to_string(last) + " by " + std::to_string(step) +
                                 "; one file for each slice is needed, at most " + std::to_string(most_files));
    std::vector<std::string> names;
    for (long long i = first; step > 0 ? i <= last : i >= last; i += step) {
        std::vector<char> name(pattern.size() + 64);
        // The pattern was checked to hold one conversion of a whole number.
        const auto index = static_cast<int>(i);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
        std::snprintf(name.data(), name.size(), pattern.c_str(), index);
#pragma GCC diagnostic pop
        names.emplace_back(name.data());
    }
    return names;
}

/// Fields behind the last one, of a MetaImage whose voxels lie elsewhere, would change nothing without a word.
void refuse_rest(const std::filesystem::path& path, const std::vector<std::string>& rest) {
    if (rest.empty()) return;
    throw unreadable(path, "its header goes on after 'ElementDataFile', which ends it, with '" +
                               shortened(rest.front()) + "'; move that line up, or remove it");
}

}  // namespace

std::string trimmed(const std::string& text) {
    const auto first = text.find_first_not_of(" \t\r\n");
    if (first == std::string::npos) return "";
    return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

std::string lower_case(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

std::string TextHeader::value(const std::string& key) const {
    const auto found = fields.find(key);
    return found == fields.end() ? "" : found->second;
}

void TextHeader::set(const std::filesystem::path& path, const std::string& key, const std::string& value) {
    const auto [field, added] = fields.try_emplace(key, value);
    if (!added && field->second != value && key != "comment")
        throw unreadable(path, "its header states '" + key + "' twice, '" + field->second + "' and '" + value +
                                   "'; leave the true one");
}

TextHeader read_nrrd_header(const std::filesystem::path& path) {
    HeadLines lines(path);
    if (lines.text().compare(0, 4, "NRRD") != 0)
        throw unreadable(path, "it does not begin with 'NRRD'; give an NRRD file");
    TextHeader header;
    for (std::string line; lines.next(line) && !line.empty();) {
        const std::size_t colon = line.find(':');
        if (line[0] == '#' || colon == std::string::npos) continue;
        // "key:=value" is a free comment pair; "key: value" is a field of the format.
        if (line.compare(colon, 2, ":=") == 0) {
            header.comments[trimmed(line.substr(0, colon))] = trimmed(line.substr(colon + 2));
            continue;
        }
        std::string key = lower_case(trimmed(line.substr(0, colon)));
        const std::string value = trimmed(line.substr(colon + 1));
        if (key == "datafile") key = "data file";
        header.set(path, key, value);
        if (key == "data file" && is_list(value)) header.listed_files = lines.rest();
    }
    header.bytes = lines.taken();
    return header;
}

TextHeader read_meta_header(const std::filesystem::path& path) {
    HeadLines lines(path);
    if (lines.text().find(frame_prefix) != std::string::npos) lines = HeadLines(path, longest_header_of_sweep);
    TextHeader header;
    for (std::string line; lines.next(line);) {
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) break;
        const std::string name = trimmed(line.substr(0, equals)), key = lower_case(name),
                          value = trimmed(line.substr(equals + 1));
        if (name.starts_with(frame_prefix)) {
            if (const auto [field, added] = header.comments.try_emplace(name, value); !added && field->second != value)
                throw unreadable(path, "its header states '" + shortened(name) + "' twice; leave the true one");
            continue;
        }
        header.set(path, key, value);
        if (key != "elementdatafile") continue;
        header.bytes = lines.taken();
        if (is_list(value))
            header.listed_files = lines.rest();
        else if (lower_case(value) != "local")
            refuse_rest(path, lines.rest());
        return header;
    }
    throw unreadable(path, "its header has no line 'ElementDataFile'; give a MetaImage file, whole");
}

std::vector<std::filesystem::path> files_of(const std::filesystem::path& header_path, const TextHeader& header,
                                            const std::string& value, std::size_t slices, std::size_t most) {
    std::vector<std::string> names{value};
    // A name may hold blanks or '%'; a pattern is followed by numbers or is one by itself.
    const std::string first_word = value.substr(0, value.find_first_of(" \t"));
    if (is_list(value))
        names = header.listed_files;
    else if (is_pattern(first_word) || (first_word != value && first_word.find('%') != std::string::npos))
        names = names_of_pattern(header_path, value, slices, most);
    std::vector<std::filesystem::path> files;
    for (const std::string& name : names) files.push_back(header_path.parent_path() / name);
    return files;
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
