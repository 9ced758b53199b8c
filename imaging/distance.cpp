#include "core/errors.hpp"
#include "imaging/detail/distance_transform.hpp"
#include "imaging/filters.hpp"

#include <tbb/parallel_for.h>

#include <cmath>

namespace tissuewarp::imaging {

namespace {

/// min(a, b) into a.
void keep_smaller(cv::Mat& a, const cv::Mat& b) {
    cv::min(a, b, a);
}

}  // namespace

Volume signed_distance(const Volume& mask) {
    if (mask.empty() || mask.channels() != 1) throw InvalidInput("signed distance: give a mask of one component");
    cv::Mat inside;
    cv::compare(mask.voxels, 0, inside, cv::CMP_NE);
    const auto count = static_cast<std::size_t>(mask.geometry.voxel_count());
    const Eigen::Vector3d& spacing = mask.geometry.spacing;

    // The boundary is the set of points halfway along grid edges that cross it, one family per axis. Each family starts
    // with distances along its own axis; the other two axes follow by parabola passes, which families share where they
    // can because a pass of a minimum is the minimum of the passes.
    cv::Mat squared = detail::squared_to_crossings(inside, 0, spacing[0]);
    detail::parabola_pass(squared, 1, spacing[1]);
    {
        cv::Mat family = detail::squared_to_crossings(inside, 1, spacing[1]);
        detail::parabola_pass(family, 0, spacing[0]);
        keep_smaller(squared, family);
    }
    detail::parabola_pass(squared, 2, spacing[2]);
    {
        cv::Mat family = detail::squared_to_crossings(inside, 2, spacing[2]);
        detail::parabola_pass(family, 0, spacing[0]);
        detail::parabola_pass(family, 1, spacing[1]);
        keep_smaller(squared, family);
    }

    float* values = squared.ptr<float>();
    const std::uint8_t* in = inside.ptr<std::uint8_t>();
    if (values[0] >= detail::unreached)
        throw InvalidInput(in[0] ? "signed distance: the mask fills the image and has no boundary; give a larger image"
                                 : "signed distance: the mask is empty; give one with voxels other than 0");
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1 << 16), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            values[i] = in[i] ? -std::sqrt(values[i]) : std::sqrt(values[i]);
    });
    return {mask.geometry, squared};
}

}  // namespace tissuewarp::imaging
