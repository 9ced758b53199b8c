#include "registration/matching/image_mask.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"

#include <opencv2/core.hpp>

namespace tissuewarp::registration {

imaging::Volume without_unmatched(const imaging::Volume& image, const imaging::Volume& mask) {
    cv::Mat nonzero;
    cv::compare(mask.voxels, 0, nonzero, cv::CMP_NE);
    const imaging::Volume allowed =
        imaging::resample({mask.geometry, nonzero}, image.geometry, imaging::Interpolation::Nearest);
    cv::Mat excluded;
    cv::compare(allowed.voxels, 0, excluded, cv::CMP_EQ);
    const auto count = cv::countNonZero(excluded.reshape(1, 1));
    if (count == image.geometry.voxel_count())
        throw InvalidInput("the mask is 0 in all of the image: nonzero means that a voxel may be matched");
    // Padding is known by neighbourhoods of one value (seen_region), which a lone voxel must have about it.
    constexpr int cube = 3;
    imaging::Volume result{image.geometry, image.as(CV_32F).voxels.clone()};
    const auto& size = image.geometry.size;
    const auto* out = excluded.ptr<std::uint8_t>();
    const cv::Mat flat = result.voxels.reshape(1, 1), kept = allowed.voxels.reshape(1, 1);
    const auto grey = static_cast<float>(cv::mean(flat, kept)[0]);
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                if (!out[result.offset(i, j, k)]) continue;
                for (int n = 0; n < cube * cube * cube; ++n) {
                    const int x = i + n % cube - 1, y = j + n / cube % cube - 1, z = k + n / (cube * cube) - 1;
                    if (x >= 0 && y >= 0 && z >= 0 && x < size[0] && y < size[1] && z < size[2])
                        result.data<float>()[result.offset(x, y, z)] = grey;
                }
            }
    return result;
}

}  // namespace tissuewarp::registration
