#include "registration/matching/points/field_of_view.hpp"

#include "registration/matching/descriptors/matching_image.hpp"

#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

/// Directions spread evenly over the sphere (Fibonacci lattice), then the axes of a grid both ways, where fields of
/// view are mostly cut.
Eigen::Matrix3Xd directions_for(const Eigen::Matrix3d& axes) {
    constexpr int spread = FieldOfViewOptions().directions;
    const double golden_angle = EIGEN_PI * (3 - std::sqrt(5.0));
    Eigen::Matrix3Xd directions(3, spread + 6);
    for (int n = 0; n < spread; ++n) {
        const double z = 1 - (2 * n + 1.0) / spread, radius = std::sqrt(1 - z * z);
        directions.col(n) << radius * std::cos(golden_angle * n), radius * std::sin(golden_angle * n), z;
    }
    directions.rightCols(6) << axes, -axes;
    return directions;
}

using Pixel = std::array<int, 2>;  // i, j

/// Puts the next end of a row to the convex chain of those before (Andrew, Inf. Process. Lett. 9 (1979) 216), that of
/// first ends with side 1, of last ends with −1.
void add_to_chain(const Pixel& end, int side, std::vector<Pixel>& chain) {
    const auto outside = [&](const Pixel& a, const Pixel& b) {  // whether b lies outside of the line from a to the end
        const std::int64_t turn =
            std::int64_t{b[0] - a[0]} * (end[1] - a[1]) - std::int64_t{end[0] - a[0]} * (b[1] - a[1]);
        return side * turn < 0;
    };
    while (chain.size() > 1 && !outside(chain[chain.size() - 2], chain.back())) chain.pop_back();
    chain.push_back(end);
}

}  // namespace

FieldOfView::FieldOfView(const imaging::Volume& seen)
    : directions_(directions_for(seen.geometry.direction)),
      support_(Eigen::VectorXd::Constant(directions_.cols(), -std::numeric_limits<double>::infinity())) {
    const auto& size = seen.geometry.size;
    Eigen::MatrixXd of_slices = support_.replicate(1, size[2]);
    tbb::parallel_for(0, size[2], [&](int k) {
        Eigen::VectorXd support = of_slices.col(k);
        std::vector<Pixel> lower, upper;
        for (int j = 0; j < size[1]; ++j) {  // the ends of a row span what the row adds to the hull
            const auto* row = seen.data<std::uint8_t>() + seen.offset(0, j, k);
            int first = 0, last = size[0] - 1;
            while (first <= last && !row[first]) ++first;
            while (last > first && !row[last]) --last;
            if (first > last) continue;
            add_to_chain({first, j}, 1, lower);
            add_to_chain({last, j}, -1, upper);
        }
        for (const std::vector<Pixel>& chain : {lower, upper})
            for (const auto& [i, j] : chain) {
                const Eigen::Vector3d point = seen.geometry.point(Eigen::Vector3d(i, j, k));
                support = support.cwiseMax(directions_.transpose() * point);
            }
        of_slices.col(k) = support;
    });
    support_ = of_slices.rowwise().maxCoeff();
}

double FieldOfView::distance(const Eigen::Vector3d& point) const {
    return (directions_.transpose() * point - support_).maxCoeff();
}

std::vector<char> FieldOfView::holds(const Eigen::Matrix3Xd& points) const {
    std::vector<char> result(static_cast<std::size_t>(points.cols()));
    tbb::parallel_for(std::size_t{0}, result.size(),
                      [&](std::size_t n) { result[n] = distance(points.col(static_cast<Eigen::Index>(n))) < 0; });
    return result;
}

}  // namespace tissuewarp::registration::detail
