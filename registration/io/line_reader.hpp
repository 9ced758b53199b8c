#pragma once
/// Text files of points, line by line, with complaints that name the line.

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::registration::detail {

/// Without blanks around it, and without quotation marks around what is left.
std::string_view trimmed(std::string_view text);

/// Trimmed fields between separators.
std::vector<std::string_view> split(std::string_view line, char separator);

/// Fields between blanks, tabulators and commas.
std::vector<std::string_view> words(std::string_view line);

class LineReader {
public:
    /// Throws IoError.
    explicit LineReader(const std::filesystem::path& path);

    /// To the next line with content that is no remark (#); false at the end. Throws IoError.
    bool next();
    /// To the next line with content, remarks included.
    bool next_of_any_kind();
    [[nodiscard]] std::string_view line() const { return line_; }

    /// Throws InvalidInput with file and line.
    [[noreturn]] void refuse(const std::string& reason) const;
    /// A finite coordinate in mm, at most 1 km; refuses anything else.
    [[nodiscard]] double coordinate(std::string_view text, std::string_view name) const;

private:
    std::filesystem::path path_;
    std::ifstream file_;
    std::string line_;
    int number_ = 0;
};

}  // namespace tissuewarp::registration::detail
