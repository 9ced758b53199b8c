#include "imaging/detail/slice_contours.hpp"

#include <map>
#include <utility>

namespace tissuewarp::imaging::detail {

namespace {

/// A place half way between two neighbours, in half voxels.
using Place = std::pair<int, int>;
/// Where the contour goes from a place: the label lies on one and the same side of all steps.
using Steps = std::map<Place, Place>;

/// The steps of marching squares in the square whose first corner is voxel (i, j).
void add_steps(Steps& steps, int i, int j, const auto& within) {
    const Place low{2 * i + 1, 2 * j}, right{2 * i + 2, 2 * j + 1}, high{2 * i + 1, 2 * j + 2}, left{2 * i, 2 * j + 1};
    const bool a = within(i, j), b = within(i + 1, j), c = within(i + 1, j + 1), d = within(i, j + 1);
    const std::pair<Place, bool> sides[4] = {{low, a != b}, {right, b != c}, {high, c != d}, {left, d != a}};
    if (a && c && !b && !d) {
        steps[low] = left;
        steps[high] = right;
    } else if (b && d && !a && !c) {
        steps[right] = low;
        steps[left] = high;
    } else if (a != b || b != c || c != d) {
        // Around the square a step enters where the label ends and leaves where it begins.
        const bool corners[5] = {a, b, c, d, a};
        Place from, to;
        for (int side = 0; side < 4; ++side) {
            if (!sides[side].second) continue;
            (corners[side] ? from : to) = sides[side].first;
        }
        steps[from] = to;
    }
}

/// The points of a loop where it turns, in voxels.
std::vector<Eigen::Vector2d> corners_of(const std::vector<Place>& loop) {
    std::vector<Eigen::Vector2d> corners;
    for (std::size_t n = 0; n < loop.size(); ++n) {
        const Place &before = loop[(n + loop.size() - 1) % loop.size()], &here = loop[n],
                    &next = loop[(n + 1) % loop.size()];
        const bool straight = here.first - before.first == next.first - here.first &&
                              here.second - before.second == next.second - here.second;
        if (!straight) corners.emplace_back(0.5 * here.first, 0.5 * here.second);
    }
    return corners;
}

}  // namespace

std::vector<Eigen::Matrix3Xd> slice_contours(const Volume& labels, int label, int k) {
    const auto [nx, ny, nz] = labels.geometry.size;
    const auto* values = labels.data<std::int32_t>();
    const auto within = [&, nx = nx, ny = ny](int i, int j) {
        return i >= 0 && j >= 0 && i < nx && j < ny && values[labels.offset(i, j, k)] == label;
    };
    Steps steps;
    for (int j = -1; j < ny; ++j)
        for (int i = -1; i < nx; ++i) add_steps(steps, i, j, within);
    std::vector<Eigen::Matrix3Xd> contours;
    while (!steps.empty()) {
        std::vector<Place> loop;
        for (auto step = steps.begin(); step != steps.end();) {
            loop.push_back(step->first);
            const Place next = step->second;
            steps.erase(step);
            step = steps.find(next);
        }
        const std::vector<Eigen::Vector2d> corners = corners_of(loop);
        Eigen::Matrix3Xd contour(3, static_cast<Eigen::Index>(corners.size()));
        for (Eigen::Index n = 0; n < contour.cols(); ++n) {
            const Eigen::Vector2d& corner = corners[static_cast<std::size_t>(n)];
            contour.col(n) = labels.geometry.point({corner[0], corner[1], double(k)});
        }
        contours.push_back(std::move(contour));
    }
    return contours;
}

}  // namespace tissuewarp::imaging::detail
