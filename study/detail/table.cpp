#include "study/detail/table.hpp"

#include "core/errors.hpp"

#include <fstream>

namespace tissuewarp::study::detail {

std::string TableLine::next() {
    std::string field;
    if (!std::getline(fields_, field, ',')) refuse("a field is missing");
    return field;
}

double TableLine::number(const std::string& field) const {
    std::istringstream stream(field);
    double value = 0;
    if (!(stream >> value) || !stream.eof()) refuse("'" + field + "' is no number");
    return value;
}

void TableLine::refuse(const std::string& why) const {
    throw InvalidInput(path_.string() + ", line " + std::to_string(line_) + ": " + why +
                       "; remove the file to have it measured again");
}

std::vector<TableLine> read_table(const std::filesystem::path& path, const std::string& header) {
    std::ifstream in(path);
    if (!in) throw IoError(path.string() + " cannot be read");
    std::string text;
    std::getline(in, text);
    if (text != header) TableLine(path, 1, text).refuse("this is no such table, or one of another version");
    std::vector<TableLine> lines;
    for (int line = 2; std::getline(in, text); ++line) lines.emplace_back(path, line, text);
    return lines;
}

}  // namespace tissuewarp::study::detail
