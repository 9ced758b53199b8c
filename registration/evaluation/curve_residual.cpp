#include "registration/evaluation/curve_residual.hpp"

#include "core/errors.hpp"
#include "meshing/search/curve_tree.hpp"
#include "registration/io/curves.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <string>

namespace tissuewarp::registration {

namespace {

using meshing::CurveTree;
using meshing::Segment;

constexpr double anywhere = std::numeric_limits<double>::infinity();

/// Lines as places every step along them, one line after the other.
struct Places {
    Eigen::Matrix3Xd points;
    std::vector<Segment> segments;  // between places in a row
    std::vector<int> line_of;       // of each place

    Places(const std::vector<Eigen::Matrix3Xd>& lines, double step_mm) {
        std::vector<Eigen::Matrix3Xd> along;
        for (const Eigen::Matrix3Xd& line : lines) along.push_back(evenly_along(line, step_mm));
        points = points_of(along);
        for (std::size_t l = 0; l < along.size(); ++l) {
            const int first = static_cast<int>(line_of.size()), last = first + static_cast<int>(along[l].cols()) - 1;
            for (int n = first; n < last; ++n) segments.push_back({{n, n + 1}, {n, n + 1}});
            line_of.insert(line_of.end(), static_cast<std::size_t>(along[l].cols()), static_cast<int>(l));
        }
    }
};

std::vector<CurveTree::Hit> nearest(const CurveTree& tree, const Eigen::Matrix3Xd& points) {
    std::vector<CurveTree::Hit> hits(static_cast<std::size_t>(points.cols()));
    tbb::parallel_for(std::size_t{0}, hits.size(), [&](std::size_t n) {
        hits[n] = *tree.nearest(points.col(static_cast<Eigen::Index>(n)), anywhere, {});
    });
    return hits;
}

std::vector<double> distances(const std::vector<CurveTree::Hit>& hits) {
    std::vector<double> result;
    for (const CurveTree::Hit& hit : hits) result.push_back(hit.distance);
    return result;
}

/// The places between those nearest to two points in a row of a piece, where both are on one line.
std::vector<Eigen::Index> shown(const Places& places, const std::vector<CurveTree::Hit>& hits,
                                const std::vector<std::vector<int>>& pieces) {
    std::vector<char> is_shown(places.line_of.size(), 0);
    const auto nearest_place = [&](int point) {
        const CurveTree::Hit& hit = hits[static_cast<std::size_t>(point)];
        return places.segments[static_cast<std::size_t>(hit.segment)].ends[hit.along < 0.5 ? 0 : 1];
    };
    for (const std::vector<int>& piece : pieces)
        for (std::size_t n = 1; n < piece.size(); ++n) {
            const auto [from, to] = std::minmax({nearest_place(piece[n - 1]), nearest_place(piece[n])});
            if (places.line_of[static_cast<std::size_t>(from)] != places.line_of[static_cast<std::size_t>(to)])
                continue;
            std::fill(is_shown.begin() + from, is_shown.begin() + to + 1, 1);
        }
    std::vector<Eigen::Index> result;
    for (std::size_t n = 0; n < is_shown.size(); ++n)
        if (is_shown[n]) result.push_back(static_cast<Eigen::Index>(n));
    return result;
}

CurveTree tree_of(const Eigen::Matrix3Xd& points, const std::vector<std::vector<int>>& pieces) {
    std::vector<Segment> segments;
    for (const std::vector<int>& piece : pieces)
        for (std::size_t n = 1; n < piece.size(); ++n)
            segments.push_back({{piece[n - 1], piece[n]}, {piece[n - 1], piece[n]}});
    return {points, std::move(segments)};
}

void require_usable(const std::vector<Eigen::Matrix3Xd>& lines, const Eigen::Matrix3Xd& points) {
    const bool whole =
        std::all_of(lines.begin(), lines.end(), [](const auto& line) { return line.cols() > 1 && line.allFinite(); });
    if (lines.empty() || !whole || points.cols() == 0 || !points.allFinite())
        throw InvalidInput("curve residual: " + std::to_string(lines.size()) + " lines and " +
                           std::to_string(points.cols()) +
                           " points; at least one of each is needed, lines of two points, all of them finite");
}

}  // namespace

CurveResidual curve_residual(const std::vector<Eigen::Matrix3Xd>& lines, const Eigen::Matrix3Xd& points,
                             const std::vector<std::vector<int>>& pieces, double step_mm) {
    require_usable(lines, points);
    const Places places(lines, step_mm);
    const std::vector<CurveTree::Hit> hits = nearest({places.points, places.segments}, points);
    CurveResidual result{summarise(distances(hits)), {}, 0};
    const std::vector<Eigen::Index> seen = shown(places, hits, pieces);
    if (seen.empty()) return result;
    result.from_lines = summarise(distances(nearest(tree_of(points, pieces), places.points(Eigen::all, seen))));
    for (std::size_t n = 1; n < seen.size(); ++n)
        if (seen[n] == seen[n - 1] + 1 &&
            places.line_of[static_cast<std::size_t>(seen[n])] == places.line_of[static_cast<std::size_t>(seen[n - 1])])
            result.shown_mm += (places.points.col(seen[n]) - places.points.col(seen[n - 1])).norm();
    return result;
}

}  // namespace tissuewarp::registration
