#pragma once
/// The part of a working grid that a search may look at, in bricks: full rows along i, cut to the range that is needed.

#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::registration::detail {

/// Indices first ≤ n < last.
struct Range {
    int first = 0, last = 0;
    [[nodiscard]] bool empty() const { return first >= last; }
    [[nodiscard]] int size() const { return last - first; }
};

class SearchRegion {
public:
    struct Brick {
        Range i, j, k;
    };

    /// All of the grid.
    explicit SearchRegion(const imaging::Geometry& grid);
    /// The cubes of ± margin voxels about points (3 × N, LPS mm), as far as they lie on the grid.
    SearchRegion(const imaging::Geometry& grid, const Eigen::Matrix3Xd& points, int margin);

    /// Those that hold something.
    [[nodiscard]] std::vector<Brick> bricks() const;
    /// What of the row (j, k) lies in a brick or within `reach` voxels of one; may leave the grid by as much.
    [[nodiscard]] Range row(int j, int k, int reach) const;

private:
    std::array<int, 3> size_;
    int rows_, columns_;          // bricks along j and k
    std::vector<Range> along_i_;  // of each brick, j fastest
};

}  // namespace tissuewarp::registration::detail
