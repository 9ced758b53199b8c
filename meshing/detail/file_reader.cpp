#include "meshing/detail/file_reader.hpp"

#include "core/file_message.hpp"
#include "core/text_table.hpp"

#include <charconv>
#include <fstream>
#include <iterator>
#include <system_error>

namespace tissuewarp::meshing::detail {

namespace {

bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
}

template <class T>
bool parse(std::string_view word, T& value) {
    if (word.starts_with('+')) word.remove_prefix(1);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return !word.empty() && error == std::errc() && end == word.data() + word.size();
}

}  // namespace

FileReader::FileReader(const std::filesystem::path& path) : path_(path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) fail("is a folder; name a file");
    std::ifstream stream(path, std::ios::binary);
    if (!stream) fail("cannot be opened; check the name and the permission");
    bytes_.assign(std::istreambuf_iterator<char>(stream), {});
    if (stream.bad()) fail("cannot be read");
}

std::string_view FileReader::token() {
    while (cursor_ < bytes_.size() && is_blank(bytes_[cursor_])) ++cursor_;
    const std::size_t start = cursor_;
    while (cursor_ < bytes_.size() && !is_blank(bytes_[cursor_])) ++cursor_;
    return text().substr(start, cursor_ - start);
}

std::string_view FileReader::line() {
    const std::size_t start = cursor_;
    const std::size_t end = std::min(bytes_.find('\n', start), bytes_.size());
    cursor_ = std::min(end + 1, bytes_.size());
    std::string_view result = text().substr(start, end - start);
    if (result.ends_with('\r')) result.remove_suffix(1);
    return result;
}

std::size_t FileReader::checked_count(long long value, std::string_view what, std::size_t bytes_each) const {
    if (value < 0 || static_cast<unsigned long long>(value) > remaining() / std::max<std::size_t>(bytes_each, 1) ||
        value > 2147483647)
        fail("announces " + std::to_string(value) + " " + std::string(what) + ", more than the file can hold");
    return static_cast<std::size_t>(value);
}

void FileReader::skip(std::size_t bytes) {
    if (remaining() < bytes) fail("ends before its data do");
    cursor_ += bytes;
}

double FileReader::to_number(std::string_view word) const {
    if (word.empty()) fail("ends before its data do");
    double value = 0.0;
    if (!parse(word, value)) fail("has '" + std::string(word.substr(0, 40)) + "' where a number is expected");
    return value;
}

long long FileReader::to_integer(std::string_view word) const {
    if (word.empty()) fail("ends before its data do");
    long long value = 0;
    if (!parse(word, value)) fail("has '" + std::string(word.substr(0, 40)) + "' where an integer is expected");
    return value;
}

void FileReader::fail(const std::string& problem) const {
    throw IoError(presentable("'" + path_.string() + "' " + problem));
}

void FileReader::refuse(const std::string& problem) const {
    throw InvalidInput(presentable("'" + path_.string() + "' " + problem));
}

std::string extension_of(const std::filesystem::path& path) {
    return lower_case(path.extension().string());
}

}  // namespace tissuewarp::meshing::detail
