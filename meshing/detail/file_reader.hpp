#pragma once
/// A file held in memory with a cursor that never leaves it: every short read becomes an IoError that names the file.

#include "core/errors.hpp"

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

namespace tissuewarp::meshing::detail {

class FileReader {
public:
    /// Reads the whole file. Throws IoError.
    explicit FileReader(const std::filesystem::path& path);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] std::string_view text() const { return bytes_; }
    [[nodiscard]] std::size_t position() const { return cursor_; }
    [[nodiscard]] std::size_t remaining() const { return bytes_.size() - cursor_; }
    void seek(std::size_t position) { cursor_ = std::min(position, bytes_.size()); }

    /// The next run of non-blank characters; empty at the end of the file.
    std::string_view token();
    /// The rest of the current line, without its end.
    std::string_view line();
    double number() { return to_number(token()); }
    long long integer() { return to_integer(token()); }
    /// A count of things that take at least `bytes_each` bytes of what is left of the file.
    std::size_t count(std::string_view what, std::size_t bytes_each) {
        return checked_count(integer(), what, bytes_each);
    }
    std::size_t checked_count(long long value, std::string_view what, std::size_t bytes_each) const;

    /// The next binary value in the given byte order.
    template <class T>
    T binary(bool big_endian = false) {
        if (remaining() < sizeof(T)) fail("ends before its data do");
        std::array<char, sizeof(T)> raw;
        std::memcpy(raw.data(), bytes_.data() + cursor_, sizeof(T));
        cursor_ += sizeof(T);
        if (big_endian) std::reverse(raw.begin(), raw.end());
        T value;
        std::memcpy(&value, raw.data(), sizeof(T));
        return value;
    }
    void skip(std::size_t bytes);

    [[nodiscard]] double to_number(std::string_view word) const;
    [[nodiscard]] long long to_integer(std::string_view word) const;

    /// Damaged file: IoError "'path' <problem>".
    [[noreturn]] void fail(const std::string& problem) const;
    /// Readable content that cannot be used: InvalidInput "'path' <problem>".
    [[noreturn]] void refuse(const std::string& problem) const;

private:
    std::filesystem::path path_;
    std::string bytes_;
    std::size_t cursor_ = 0;
};

/// Lower-case extension with its dot.
std::string extension_of(const std::filesystem::path& path);

}  // namespace tissuewarp::meshing::detail
