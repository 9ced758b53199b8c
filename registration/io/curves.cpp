#include "registration/io/curves.hpp"

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/point_table.hpp"
#include "registration/io/extent.hpp"
#include "registration/io/slicer_markups.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

namespace tissuewarp::registration {

namespace {

using meshing::Polylines;

template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    throw InvalidInput(text.str());
}

Polylines read_table(const std::filesystem::path& path, Observer& observer) {
    meshing::PointTable table = meshing::read_point_table(path);
    for (const std::string& note : table.notes) observer.note(note);
    std::vector<std::vector<int>> lines;
    std::map<std::string, std::size_t> line_of;
    for (std::size_t n = 0; n < table.groups.size(); ++n) {
        if (table.groups[n].empty()) continue;
        const auto [entry, added] = line_of.try_emplace(table.groups[n], lines.size());
        if (added) lines.emplace_back();
        lines[entry->second].push_back(static_cast<int>(n));
    }
    std::erase_if(lines, [](const std::vector<int>& line) { return line.size() < 2; });
    return {std::move(table.points), std::move(lines)};
}

void require_usable_lines(const std::vector<Eigen::Matrix3Xd>& lines) {
    constexpr double most_length_mm = 1e5;
    if (lines.empty()) refuse("the moving curves hold no line; lines of two points or more are needed");
    double length = 0;
    for (std::size_t n = 0; n < lines.size(); ++n) {
        const Eigen::Matrix3Xd& line = lines[n];
        if (line.cols() < 2) refuse("moving curve ", n, " has ", line.cols(), " points; at least 2 are needed");
        if (!line.allFinite()) refuse("moving curve ", n, " has points that are not finite; remove them");
        length += (line.rightCols(line.cols() - 1) - line.leftCols(line.cols() - 1)).colwise().norm().sum();
    }
    detail::require_millimetres(points_of(lines), "the moving curves are");
    if (length > most_length_mm)
        refuse("the moving curves are ", length / 1000,
               " m long in all, more than 100; check that their points are "
               "joined in order");
}

void require_usable_tangents(const Curves& curves) {
    const Eigen::Matrix3Xd& tangents = curves.tangents;
    if (tangents.cols() != 0 && tangents.cols() != curves.fixed.cols())
        refuse("the fixed curves have ", tangents.cols(), " tangents for ", curves.fixed.cols(),
               " points; give all, zero where one is not known, or none");
    for (Eigen::Index n = 0; n < tangents.cols(); ++n) {
        const double length = tangents.col(n).norm();
        if (length != 0 && !(std::abs(length - 1) < 1e-3))
            refuse("the fixed curves have a tangent of length ", length, " at point ", n, "; unit tangents or zero");
    }
}

}  // namespace

Polylines read_curve_file(const std::filesystem::path& path, Observer& observer) {
    const std::string extension = lower_case(path.extension().string());
    if (extension == ".csv" || extension == ".xyz") return read_table(path, observer);
    if (extension == ".vtk" || extension == ".vtp") return meshing::read_polylines(path, observer);
    if (is_slicer_markups(path)) {
        Markups markups = read_slicer_markups(path, observer);
        return {std::move(markups.points), std::move(markups.lines)};
    }
    throw InvalidInput(path.string() +
                       ": curves are read from .vtk and .vtp (polydata), .csv (x,y,z,line) and markups of 3D Slicer");
}

Eigen::Matrix3Xd points_of(const std::vector<Eigen::Matrix3Xd>& lines) {
    Eigen::Index count = 0;
    for (const auto& line : lines) count += line.cols();
    Eigen::Matrix3Xd points(3, count);
    count = 0;
    for (const auto& line : lines) {
        points.middleCols(count, line.cols()) = line;
        count += line.cols();
    }
    return points;
}

Eigen::Matrix3Xd tangents_along(const Eigen::Matrix3Xd& line, double reach_mm) {
    std::vector<double> lengths{0};
    for (Eigen::Index n = 1; n < line.cols(); ++n)
        lengths.push_back(lengths.back() + (line.col(n) - line.col(n - 1)).norm());
    Eigen::Matrix3Xd tangents = Eigen::Matrix3Xd::Zero(3, line.cols());
    if (lengths.back() < reach_mm) return tangents;
    std::size_t from = 0, to = 0;
    for (std::size_t n = 0; n < lengths.size(); ++n) {
        while (from + 1 < n && lengths[from + 1] <= lengths[n] - reach_mm) ++from;
        while (to + 1 < lengths.size() && lengths[to] < lengths[n] + reach_mm) ++to;
        const Eigen::Vector3d chord =
            line.col(static_cast<Eigen::Index>(to)) - line.col(static_cast<Eigen::Index>(from));
        tangents.col(static_cast<Eigen::Index>(n)) = chord.stableNormalized();
    }
    return tangents;
}

Eigen::Matrix3Xd evenly_along(const Eigen::Matrix3Xd& line, double step_mm) {
    std::vector<double> lengths{0};
    for (Eigen::Index n = 1; n < line.cols(); ++n)
        lengths.push_back(lengths.back() + (line.col(n) - line.col(n - 1)).norm());
    const auto pieces = std::max<Eigen::Index>(1, std::lround(lengths.back() / step_mm));
    Eigen::Matrix3Xd result(3, pieces + 1);
    std::size_t next = 1;
    for (Eigen::Index n = 0; n <= pieces; ++n) {
        const double length = lengths.back() * double(n) / double(pieces);
        while (next + 1 < lengths.size() && lengths[next] < length) ++next;
        const double whole = lengths[next] - lengths[next - 1];
        const double share = whole > 0 ? std::clamp((length - lengths[next - 1]) / whole, 0.0, 1.0) : 0.0;
        const auto to = static_cast<Eigen::Index>(next);
        result.col(n) = (1 - share) * line.col(to - 1) + share * line.col(to);
    }
    return result;
}

void require_usable(const Curves& curves) {
    constexpr Eigen::Index least_points = 5;
    require_usable_lines(curves.moving);
    if (curves.fixed.cols() < least_points)
        refuse("the fixed curves have ", curves.fixed.cols(), " points; at least ", least_points, " are needed");
    if (!curves.fixed.allFinite()) refuse("the fixed curves have points that are not finite; remove them");
    require_usable_tangents(curves);
    if (!(curves.deviation_mm > 0) || !std::isfinite(curves.deviation_mm))
        refuse("the standard deviation of points along vessels is ", curves.deviation_mm,
               " mm; a positive number is needed");
    detail::require_millimetres(curves.fixed, "the fixed curves are");
}

Curves read_curves(const std::filesystem::path& moving, const std::filesystem::path& fixed, double deviation_mm,
                   Observer& observer) {
    constexpr double least_reach_mm = 2.5;
    const Polylines before = read_curve_file(moving, observer), during = read_curve_file(fixed, observer);
    if (before.lines.empty())
        throw InvalidInput(
            moving.string() +
            ": holds no line; give .vtk or .vtp with lines, .csv with a column 'line', or curves of 3D Slicer");
    Curves curves;
    for (const std::vector<int>& line : before.lines) curves.moving.emplace_back(before.nodes(Eigen::all, line));
    curves.fixed = during.nodes;
    curves.tangents = Eigen::Matrix3Xd::Zero(3, during.nodes.cols());
    curves.deviation_mm = deviation_mm;
    for (const std::vector<int>& line : during.lines)
        curves.tangents(Eigen::all, line) =
            tangents_along(during.nodes(Eigen::all, line), std::max(least_reach_mm, 2.5 * deviation_mm));
    try {
        require_usable(curves);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(moving.string() + ", " + fixed.string() + ": " + problem.what());
    }
    return curves;
}

}  // namespace tissuewarp::registration
