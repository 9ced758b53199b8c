#pragma once
/// Planes through the patient for display, aligned with LPS whatever the volumes' axes, in radiological convention.

#include "imaging/filters.hpp"
#include "report/page.hpp"

#include <Eigen/Geometry>

#include <array>
#include <optional>

namespace tissuewarp::report::detail {

/// Where the organ lies in the fixed frame: the fixed labels or, where nobody drew them, the warped ones. Throws
/// InvalidInput when there are neither.
const imaging::Volume& organ_labels(const ReportInput& input);

/// A box in LPS mm.
struct Box {
    Eigen::Vector3d lower, upper;
    [[nodiscard]] Eigen::Vector3d centre() const { return (lower + upper) / 2; }
    [[nodiscard]] Eigen::Vector3d extent() const { return upper - lower; }
};

/// The box of the voxels with a label; nothing when there are none.
std::optional<Box> label_box(const imaging::Volume& labels);
Box around(const Eigen::Vector3d& centre, const Eigen::Vector3d& extent);

/// A picture's plane: pixel (column, row) of `grid` lies at grid.point({column, row, 0}).
struct Plane {
    const char* name;                         ///< axial, coronal, sagittal
    const char *left, *right, *top, *bottom;  ///< letters of R L A P S I
    char axis;                                ///< of LPS, which the plane is perpendicular to
    double position = 0;                      ///< mm along that axis
    imaging::Geometry grid;                   ///< one voxel thick
};

/// The axial, coronal and sagittal plane through a point, covering the box. Left of the picture is the patient's right
/// (axial, coronal) or front (sagittal).
std::array<Plane, 3> planes_through(const Eigen::Vector3d& point, const Box& box, double mm_per_pixel);

/// Values on a plane: rows × columns, of the volume's type; zero outside.
cv::Mat slice(const imaging::Volume& volume, const Plane& plane, imaging::Interpolation interpolation);

/// Labels on a plane, int32, nearest neighbour.
cv::Mat label_slice(const imaging::Volume& labels, const Plane& plane);

/// Grey values between these are shown from black to white.
struct Window {
    double lower = 0, upper = 1;
};

/// Percentiles 1 and 99.5 of the voxels within the box.
Window window_of(const imaging::Volume& image, const Box& box);

/// A plane of a windowed image, float32 in [0, 1].
cv::Mat grey_slice(const imaging::Volume& image, const Window& window, const Plane& plane);

/// Displacement beyond the rigid alignment (or all of it, without one): magnitude in mm on the moving grid, float32.
imaging::Volume elastic_magnitude(const imaging::Volume& moving_to_fixed, const Eigen::Isometry3d& alignment);

/// Where tissue moved most: value (mm), place in the moving image, and in the fixed one.
struct Focus {
    double displacement = 0;
    Eigen::Vector3d moving, fixed;
};
Focus largest_displacement(const imaging::Volume& moving_to_fixed, const imaging::Volume& magnitude,
                           const imaging::Volume& moving_labels);

}  // namespace tissuewarp::report::detail
