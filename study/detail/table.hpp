#pragma once
/// Tables of a study as CSV: a header, then a line for each row.

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

namespace tissuewarp::study::detail {

/// Fields of a line, one after the other. Throws InvalidInput, naming file and line, where one is missing or wrong.
class TableLine {
public:
    TableLine(const std::filesystem::path& path, int line, const std::string& text)
        : path_(path), line_(line), fields_(text) {}

    [[nodiscard]] std::string next();
    [[nodiscard]] double number() { return number(next()); }
    [[nodiscard]] double number(const std::string& field) const;
    [[noreturn]] void refuse(const std::string& why) const;

private:
    const std::filesystem::path& path_;
    int line_;
    std::istringstream fields_;
};

/// The lines under a header. Throws IoError, InvalidInput for another header.
std::vector<TableLine> read_table(const std::filesystem::path& path, const std::string& header);

}  // namespace tissuewarp::study::detail
