#include "core/errors.hpp"
#include "registration/evaluation.hpp"
#include "registration/io/line_reader.hpp"
#include "registration/io/slicer_markups.hpp"

#include <algorithm>
#include <charconv>
#include <set>
#include <string>
#include <string_view>

namespace tissuewarp::registration {

namespace {

using detail::LineReader;
using detail::split;
using detail::trimmed;
using detail::words;

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

Markups read_points_of_any_kind(const std::filesystem::path& path) {
    if (is_slicer_markups(path)) return read_slicer_markups(path);
    return {read_elastix_points(path), {}, {}};
}

/// Whether both files name all points, each differently, and by the same names.
bool same_names(const Markups& a, const Markups& b) {
    const std::set<std::string> names(a.labels.begin(), a.labels.end());
    return !names.empty() && names.size() == a.labels.size() && !names.contains("") &&
           names.size() == b.labels.size() && names == std::set<std::string>(b.labels.begin(), b.labels.end());
}

std::string names_without_partner(const Markups& a, const Markups& b) {
    const std::set<std::string> left(a.labels.begin(), a.labels.end()), right(b.labels.begin(), b.labels.end());
    std::vector<std::string> alone;
    std::set_symmetric_difference(left.begin(), left.end(), right.begin(), right.end(), std::back_inserter(alone));
    if (left.empty() || right.empty() || alone.empty()) return "";
    std::string text = "; only one of them has " + alone.front();
    for (std::size_t i = 1; i < std::min<std::size_t>(alone.size(), 5); ++i) text += ", " + alone[i];
    return text + (alone.size() > 5 ? ", …" : "");
}

/// Precondition: same_names.
Eigen::Matrix3Xd in_the_order_of(const std::vector<std::string>& labels, const Markups& markups) {
    Eigen::Matrix3Xd points(3, markups.points.cols());
    for (std::size_t i = 0; i < labels.size(); ++i) {
        const auto at = std::find(markups.labels.begin(), markups.labels.end(), labels[i]) - markups.labels.begin();
        points.col(static_cast<Eigen::Index>(i)) = markups.points.col(at);
    }
    return points;
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
    Markups from = read_points_of_any_kind(moving), to = read_points_of_any_kind(fixed);
    if (from.points.cols() != to.points.cols())
        throw InvalidInput(moving.string() + " has " + std::to_string(from.points.cols()) + " points and " +
                           fixed.string() + " has " + std::to_string(to.points.cols()) +
                           "; corresponding points need equal numbers" + names_without_partner(from, to));
    if (!same_names(from, to)) return {from.points, to.points};
    return {from.points, in_the_order_of(from.labels, to)};
}

}  // namespace tissuewarp::registration
