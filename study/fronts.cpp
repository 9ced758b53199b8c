#include "study/fronts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tissuewarp::study {

std::vector<std::size_t> pareto_front(const std::vector<Cost>& points) {
    std::vector<std::size_t> order(points.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        if (points[a].seconds != points[b].seconds) return points[a].seconds < points[b].seconds;
        return points[a].error_mm < points[b].error_mm;
    });
    std::vector<std::size_t> front;
    double least = std::numeric_limits<double>::infinity();
    for (const std::size_t i : order) {
        if (!(points[i].error_mm < least)) continue;
        least = points[i].error_mm;
        front.push_back(i);
    }
    return front;
}

std::size_t knee(const std::vector<Cost>& points, double share) {
    double least = std::numeric_limits<double>::infinity();
    for (const Cost& point : points) least = std::min(least, point.error_mm);
    std::size_t best = points.size();
    for (std::size_t i = 0; i < points.size(); ++i) {
        const bool good = points[i].error_mm <= (1 + share) * least;
        if (good && (best == points.size() || points[i].seconds < points[best].seconds)) best = i;
    }
    return best;
}

std::vector<LevelSegment> level_line(const std::vector<double>& x, const std::vector<double>& y,
                                     const Eigen::MatrixXd& values, double level) {
    std::vector<LevelSegment> segments;
    const auto crossing = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) -> Eigen::Vector2d {
        const double t = (std::log(level) - a.z()) / (b.z() - a.z());
        return (a + t * (b - a)).head<2>().array().exp();
    };
    for (Eigen::Index i = 0; i + 1 < values.rows(); ++i)
        for (Eigen::Index j = 0; j + 1 < values.cols(); ++j) {
            const auto corner = [&](Eigen::Index di, Eigen::Index dj) {
                return Eigen::Vector3d(std::log(x[static_cast<std::size_t>(j + dj)]),
                                       std::log(y[static_cast<std::size_t>(i + di)]), std::log(values(i + di, j + dj)));
            };
            const std::array<Eigen::Vector3d, 4> around{corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)};
            if (!std::all_of(around.begin(), around.end(), [](const auto& c) { return c.allFinite(); })) continue;
            std::vector<Eigen::Vector2d> ends;
            for (std::size_t c = 0; c < 4; ++c) {
                const Eigen::Vector3d &a = around[c], &b = around[(c + 1) % 4];
                if ((a.z() < std::log(level)) != (b.z() < std::log(level))) ends.push_back(crossing(a, b));
            }
            for (std::size_t e = 0; e + 1 < ends.size(); e += 2) segments.push_back({ends[e], ends[e + 1]});
        }
    return segments;
}

}  // namespace tissuewarp::study
