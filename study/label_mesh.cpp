#include "study/label_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

namespace tissuewarp::study {

imaging::Volume one_tissue(const imaging::Volume& label_map, const std::vector<int>& labels) {
    imaging::Volume tissue = label_map.clone();
    const std::span<std::int32_t> voxels(tissue.data<std::int32_t>(), tissue.voxels.total());
    for (std::int32_t& voxel : voxels) {
        const bool wanted =
            labels.empty() ? voxel != 0 : std::find(labels.begin(), labels.end(), voxel) != labels.end();
        voxel = wanted ? 1 : 0;
    }
    return tissue;
}

double edge_length_for(const imaging::Volume& label_map, int tetrahedra) {
    const double volume = cv::countNonZero(label_map.voxels.reshape(1, 1)) * label_map.geometry.spacing.prod();  // mm³
    return std::cbrt(8.5 * volume / tetrahedra);
}

}  // namespace tissuewarp::study
