#include "core/errors.hpp"
#include "registration/evaluation.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>

namespace tissuewarp::registration {

namespace {

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

/// Lines with content, each with its number; knows how to complain about them.
class LineReader {
public:
    explicit LineReader(const std::filesystem::path& path) : path_(path), file_(path) {
        if (!file_ || std::filesystem::is_directory(path))
            throw IoError(path.string() + ": cannot be opened; check that the file exists and may be read");
    }

    bool next() {
        while (std::getline(file_, line_)) {
            if (++number_ == 1 && line_.starts_with("\xEF\xBB\xBF")) line_.erase(0, 3);  // byte-order mark
            if (const auto text = trimmed(line_); !text.empty() && text.front() != '#') return true;
        }
        if (file_.bad()) throw IoError(path_.string() + ": reading failed after line " + std::to_string(number_));
        return false;
    }

    [[nodiscard]] std::string_view line() const { return line_; }

    [[noreturn]] void refuse(const std::string& reason) const {
        throw InvalidInput(path_.string() + ":" + std::to_string(number_) + ": " + reason);
    }

    [[nodiscard]] double coordinate(std::string_view text, std::string_view name) const {
        double value = 0.0;
        const std::string_view digits = text.starts_with('+') ? text.substr(1) : text;
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        if (error != std::errc{} || end != digits.data() + digits.size() || digits.empty())
            refuse(std::string(name) + " is '" + std::string(text.substr(0, 40)) + "'; a number in mm is needed");
        if (!std::isfinite(value) || std::abs(value) > 1e6)
            refuse(std::string(name) + " is " + std::string(text) + "; a finite coordinate in mm is needed");
        return value;
    }

private:
    std::filesystem::path path_;
    std::ifstream file_;
    std::string line_;
    int number_ = 0;
};

Eigen::Matrix3Xd as_matrix(const std::vector<Eigen::Vector3d>& points) {
    Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t p = 0; p < points.size(); ++p) matrix.col(static_cast<Eigen::Index>(p)) = points[p];
    return matrix;
}

Eigen::Matrix3Xd read_elastix_points(const std::filesystem::path& path) {
    LineReader reader(path);
    if (!reader.next()) reader.refuse("the file is empty; a line 'point', a count and one point per line are needed");
    if (const auto kind = trimmed(reader.line()); kind != "point")
        reader.refuse("starts with '" + std::string(kind.substr(0, 40)) +
                      "'; only files of physical points, starting with 'point', can be read");
    long long count = 0;
    if (reader.next()) {
        const auto text = trimmed(reader.line());
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
        if (error != std::errc{} || end != text.data() + text.size()) count = 0;
    }
    if (count < 1) reader.refuse("the second line must be the number of points, at least 1");
    std::vector<Eigen::Vector3d> points;
    while (reader.next()) {
        const auto fields = words(reader.line());
        if (fields.size() != 3)
            reader.refuse(std::to_string(fields.size()) + " numbers; a point needs three: x y z in mm");
        points.emplace_back(reader.coordinate(fields[0], "x"), reader.coordinate(fields[1], "y"),
                            reader.coordinate(fields[2], "z"));
    }
    if (static_cast<long long>(points.size()) != count)
        reader.refuse("the file ends after " + std::to_string(points.size()) + " points; its second line promises " +
                      std::to_string(count));
    return as_matrix(points);
}

}  // namespace

Landmarks read_landmarks(const std::filesystem::path& path) {
    constexpr std::array<std::string_view, 6> names{"pre_x", "pre_y", "pre_z", "intra_x", "intra_y", "intra_z"};
    LineReader reader(path);
    if (!reader.next())
        reader.refuse("the file is empty; a header naming pre_x,pre_y,pre_z,intra_x,intra_y,intra_z is needed");
    const auto header = split(reader.line(), ',');
    const std::size_t columns = header.size();
    std::array<std::size_t, 6> column{};
    for (std::size_t c = 0; c < names.size(); ++c) {
        const auto found = std::find(header.begin(), header.end(), names[c]);
        if (found == header.end())
            reader.refuse("the header lacks the column " + std::string(names[c]) +
                          "; it must name pre_x,pre_y,pre_z,intra_x,intra_y,intra_z");
        column[c] = static_cast<std::size_t>(found - header.begin());
    }
    std::vector<Eigen::Vector3d> moving, fixed;
    while (reader.next()) {
        const auto fields = split(reader.line(), ',');
        if (fields.size() != columns)
            reader.refuse(std::to_string(fields.size()) + " fields; the header names " + std::to_string(columns));
        std::array<double, 6> value{};
        for (std::size_t c = 0; c < names.size(); ++c) value[c] = reader.coordinate(fields[column[c]], names[c]);
        moving.emplace_back(value[0], value[1], value[2]);
        fixed.emplace_back(value[3], value[4], value[5]);
    }
    if (moving.empty()) reader.refuse("no landmark follows the header; at least one row is needed");
    return {as_matrix(moving), as_matrix(fixed)};
}

Landmarks read_landmarks(const std::filesystem::path& moving, const std::filesystem::path& fixed) {
    Landmarks landmarks{read_elastix_points(moving), read_elastix_points(fixed)};
    if (landmarks.moving.cols() != landmarks.fixed.cols())
        throw InvalidInput(moving.string() + " has " + std::to_string(landmarks.moving.cols()) + " points and " +
                           fixed.string() + " has " + std::to_string(landmarks.fixed.cols()) +
                           "; corresponding points need equal numbers");
    return landmarks;
}

}  // namespace tissuewarp::registration
