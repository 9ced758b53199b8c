#include "registration/io/line_reader.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

namespace tissuewarp::registration::detail {

std::string_view trimmed(std::string_view text) {
    const auto blank = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
    while (!text.empty() && blank(text.front())) text.remove_prefix(1);
    while (!text.empty() && blank(text.back())) text.remove_suffix(1);
    if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
    return text;
}

std::vector<std::string_view> split(std::string_view line, char separator) {
    std::vector<std::string_view> fields;
    for (std::size_t start = 0;;) {
        const std::size_t end = std::min(line.find(separator, start), line.size());
        fields.push_back(trimmed(line.substr(start, end - start)));
        if (end == line.size()) return fields;
        start = end + 1;
    }
}

std::vector<std::string_view> words(std::string_view line) {
    std::vector<std::string_view> fields;
    for (std::string_view rest = trimmed(line); !rest.empty();) {
        const std::size_t end = std::min(rest.find_first_of(" \t,"), rest.size());
        fields.push_back(rest.substr(0, end));
        rest = trimmed(rest.substr(std::min(end + 1, rest.size())));
    }
    return fields;
}

LineReader::LineReader(const std::filesystem::path& path) : path_(path), file_(path) {
    if (!file_ || std::filesystem::is_directory(path))
        throw IoError(path.string() + ": cannot be opened; check that the file exists and may be read");
}

bool LineReader::next_of_any_kind() {
    while (std::getline(file_, line_)) {
        if (++number_ == 1 && line_.starts_with("\xEF\xBB\xBF")) line_.erase(0, 3);  // byte-order mark
        if (!trimmed(line_).empty()) return true;
    }
    if (file_.bad()) throw IoError(path_.string() + ": reading failed after line " + std::to_string(number_));
    return false;
}

bool LineReader::next() {
    while (next_of_any_kind())
        if (trimmed(line_).front() != '#') return true;
    return false;
}

void LineReader::refuse(const std::string& reason) const {
    throw InvalidInput(path_.string() + ":" + std::to_string(number_) + ": " + reason);
}

double LineReader::coordinate(std::string_view text, std::string_view name) const {
    double value = 0.0;
    const std::string_view digits = text.starts_with('+') ? text.substr(1) : text;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc{} || end != digits.data() + digits.size() || digits.empty())
        refuse(std::string(name) + " is '" + std::string(text.substr(0, 40)) + "'; a number in mm is needed");
    if (!std::isfinite(value) || std::abs(value) > 1e6)
        refuse(std::string(name) + " is " + std::string(text) + "; a finite coordinate in mm is needed");
    return value;
}

}  // namespace tissuewarp::registration::detail
