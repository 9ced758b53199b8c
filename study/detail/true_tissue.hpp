#pragma once
/// Where the tissue of a phantom is, and where it truly went.

#include <Eigen/Geometry>

#include <functional>
#include <optional>

namespace tissuewarp::study::detail {

struct TrueTissue {
    using Map = std::function<std::optional<Eigen::Vector3d>(const Eigen::Vector3d&)>;

    std::function<int(const Eigen::Vector3d&)> label;              ///< at rest: 0 outside, 1 organ, 2 inclusion
    std::function<double(const Eigen::Vector3d&)> outer_distance;  ///< at rest, about mm, negative inside
    Map forward, backward;                                         ///< moving → fixed frame and back; of tissue alone
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();   ///< moving → fixed, of what surrounds the organ
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double reach = 0, length = 0;  ///< mm: of a ball about the centre that holds the organ; of the organ
    std::function<bool(const Eigen::Vector3d&)> hollow = {};  ///< whether a place (fixed frame) without tissue lies in
                                                              ///< the hole of resected tissue; null: where tissue
                                                              ///< encloses it
    std::optional<double> cavity_grey = {};  ///< of what fills the hole of resected tissue, in images; none: no hole
};

}  // namespace tissuewarp::study::detail
