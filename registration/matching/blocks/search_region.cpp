#include "registration/matching/blocks/search_region.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

constexpr int brick_side = 32;  // voxels along j and k: the borders that neighbours compute twice against the cache

int bricks_along(int size) {
    return (size + brick_side - 1) / brick_side;
}

Range on_grid(double first, double last, int size) {
    return {static_cast<int>(std::clamp(std::floor(first), 0.0, double(size))),
            static_cast<int>(std::clamp(std::ceil(last) + 1, 0.0, double(size)))};
}

Range united(const Range& a, const Range& b) {
    if (a.empty()) return b;
    return {std::min(a.first, b.first), std::max(a.last, b.last)};
}

/// Bricks that a range of voxels touches, of `count`.
Range bricks_of(const Range& voxels, int count) {
    const auto below = [](int n) { return n >= 0 ? n / brick_side : -1; };
    return {std::clamp(below(voxels.first), 0, count), std::clamp(below(voxels.last - 1) + 1, 0, count)};
}

}  // namespace

SearchRegion::SearchRegion(const imaging::Geometry& grid)
    : size_(grid.size),
      rows_(bricks_along(grid.size[1])),
      columns_(bricks_along(grid.size[2])),
      along_i_(static_cast<std::size_t>(rows_) * columns_, Range{0, grid.size[0]}) {}

SearchRegion::SearchRegion(const imaging::Geometry& grid, const Eigen::Matrix3Xd& points, int margin)
    : SearchRegion(grid) {
    std::fill(along_i_.begin(), along_i_.end(), Range{});
    for (Eigen::Index n = 0; n < points.cols(); ++n) {
        const Eigen::Vector3d index = grid.index(points.col(n));
        const auto about = [&](Eigen::Index a) {
            return on_grid(index[a] - margin, index[a] + margin, size_[static_cast<std::size_t>(a)]);
        };
        const Range i = about(0), j = about(1), k = about(2);
        if (i.empty() || j.empty() || k.empty()) continue;
        const Range bj = bricks_of(j, rows_), bk = bricks_of(k, columns_);
        for (int c = bk.first; c < bk.last; ++c)
            for (int r = bj.first; r < bj.last; ++r) {
                Range& brick = along_i_[static_cast<std::size_t>(r + rows_ * c)];
                brick = united(brick, i);
            }
    }
}

std::vector<SearchRegion::Brick> SearchRegion::bricks() const {
    const auto along = [](int brick, int size) {
        return Range{brick * brick_side, std::min((brick + 1) * brick_side, size)};
    };
    std::vector<Brick> result;
    for (int c = 0; c < columns_; ++c)
        for (int r = 0; r < rows_; ++r)
            if (const Range i = along_i_[static_cast<std::size_t>(r + rows_ * c)]; !i.empty())
                result.push_back({i, along(r, size_[1]), along(c, size_[2])});
    return result;
}

Range SearchRegion::row(int j, int k, int reach) const {
    const Range bj = bricks_of({j - reach, j + reach + 1}, rows_), bk = bricks_of({k - reach, k + reach + 1}, columns_);
    Range result;
    for (int c = bk.first; c < bk.last; ++c)
        for (int r = bj.first; r < bj.last; ++r) {
            const Range& brick = along_i_[static_cast<std::size_t>(r + rows_ * c)];
            if (!brick.empty()) result = united(result, {brick.first - reach, brick.last + reach});
        }
    return result;
}

}  // namespace tissuewarp::registration::detail
