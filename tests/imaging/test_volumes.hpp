#pragma once
/// Small volumes and a folder for files, shared by the tests of imaging.

#include "imaging/volume.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <random>
#include <string>

namespace tissuewarp::imaging::test {

inline constexpr double degree = 0.017453292519943295;

/// Oblique, anisotropic and, when asked, left-handed.
inline Geometry oblique_grid(std::array<int, 3> size = {7, 9, 11}, bool left_handed = false) {
    Geometry grid;
    grid.size = size;
    grid.origin = {-31.25, 17.5, 103.75};
    grid.spacing = {0.75, 1.25, 2.5};
    grid.direction = (Eigen::AngleAxisd(25 * degree, Eigen::Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(-40 * degree, Eigen::Vector3d::UnitX()) *
                      Eigen::AngleAxisd(10 * degree, Eigen::Vector3d::UnitY()))
                         .toRotationMatrix();
    if (left_handed) grid.direction.col(2) *= -1.0;
    return grid;
}

inline Geometry plain_grid(std::array<int, 3> size, Eigen::Vector3d spacing = {1, 1, 1}) {
    Geometry grid;
    grid.size = size;
    grid.spacing = spacing;
    return grid;
}

/// The components of all voxels as one row.
inline cv::Mat flat(const cv::Mat& voxels) {
    return cv::Mat(1, static_cast<int>(voxels.total()) * voxels.channels(), voxels.depth(), voxels.data);
}

inline double largest_difference(const cv::Mat& a, const cv::Mat& b) {
    return cv::norm(flat(a), flat(b), cv::NORM_INF);
}

/// Whole numbers from 0 to 100, which every voxel type holds exactly.
inline Volume random_volume(const Geometry& grid, int cv_type, unsigned seed = 1) {
    Volume volume(grid, cv_type);
    cv::RNG random(seed);
    random.fill(flat(volume.voxels), cv::RNG::UNIFORM, 0, 101);
    if (volume.voxels.depth() >= CV_32F) {
        cv::Mat whole;
        volume.voxels.convertTo(whole, CV_32S);
        whole.convertTo(volume.voxels, volume.voxels.depth());
    }
    return volume;
}

inline bool same_voxels(const cv::Mat& a, const cv::Mat& b) {
    return a.type() == b.type() && a.size == b.size && std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

using tissuewarp::test::TemporaryFolder;

/// Runs `call` and returns the message of the exception of type E that it throws; fails the test otherwise.
template <class E, class Call>
std::string message_of(const Call& call) {
    try {
        call();
    } catch (const E& error) {
        return error.what();
    } catch (const std::exception& error) {
        ADD_FAILURE() << "another exception: " << error.what();
        return "";
    }
    ADD_FAILURE() << "no exception";
    return "";
}

}  // namespace tissuewarp::imaging::test
