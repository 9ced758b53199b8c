#pragma once
/// The shape of a random organ: a bent ellipsoid with low bumps, and an ellipsoid in it.

#include "study/detail/random.hpp"

#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::study::detail {

/// How large a random organ and its inclusion are, mm.
struct OrganRange {
    double least_length = 60, most_length = 150;
    std::optional<double> inclusion_radius =
        {};  ///< at first; none: a twentieth to an eighth of the length, at least 6
};

/// Where a smooth function is 0. Negative inside, about the distance near the surface, mm.
class OrganShape {
public:
    /// An organ with the proportions of a brain, a liver or a kidney.
    explicit OrganShape(Random& random, const OrganRange& range = {});

    /// 0 outside, 1 organ, 2 inclusion, at a point (LPS mm).
    [[nodiscard]] int label(const Eigen::Vector3d& point) const;
    /// About the distance to the organ's surface, negative inside, mm.
    [[nodiscard]] double outer_distance(const Eigen::Vector3d& point) const;
    /// The same to the inclusion's.
    [[nodiscard]] double inclusion_distance(const Eigen::Vector3d& point) const;
    /// The point of the nearer one of both surfaces near a point that is no more than a few mm from it.
    [[nodiscard]] Eigen::Vector3d on_surface(const Eigen::Vector3d& point) const;
    /// Outward unit normal of the organ's surface near a point.
    [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
    /// Where the ray from the centre meets the organ's surface.
    [[nodiscard]] Eigen::Vector3d surface_point(const Eigen::Vector3d& direction) const;

    [[nodiscard]] const Eigen::Vector3d& centre() const { return centre_; }
    [[nodiscard]] double length() const { return length_; }  ///< mm, along the longest axis
    [[nodiscard]] const Eigen::Vector3d& inclusion_centre() const { return inclusion_centre_; }
    [[nodiscard]] double inclusion_volume() const { return 4.0 / 3 * EIGEN_PI * inclusion_axes_.prod(); }  ///< mm³
    [[nodiscard]] double inclusion_radius() const { return inclusion_axes_.mean(); }                       ///< mm
    [[nodiscard]] const std::string& kind() const { return kind_; }

    /// Radius (mm) of a ball about the centre that holds the organ.
    [[nodiscard]] double reach() const;

private:
    struct Bump {
        Eigen::Vector3d direction;
        double height, sharpness;
    };

    void place_inclusion(Random& random, std::optional<double> radius_mm);
    [[nodiscard]] double level(const Eigen::Vector3d& point) const;
    [[nodiscard]] double inclusion_level(const Eigen::Vector3d& point) const;

    std::string kind_;
    double length_ = 0, bend_ = 0;
    Eigen::Vector3d centre_, axes_;
    Eigen::Matrix3d frame_, inclusion_frame_;
    std::vector<Bump> bumps_;
    Eigen::Vector3d inclusion_centre_ = Eigen::Vector3d::Zero(), inclusion_axes_ = Eigen::Vector3d::Ones();
};

/// The label map of a shape on a grid of `voxel_mm` along the LPS axes with 10 mm around the organ, int32.
imaging::Volume draw(const OrganShape& shape, double voxel_mm);

}  // namespace tissuewarp::study::detail
