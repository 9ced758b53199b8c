#pragma once
/// A three-dimensional image in memory: an OpenCV matrix with ITK geometry.

#include "imaging/geometry.hpp"

#include <opencv2/core.hpp>

#include <cstdint>

namespace tissuewarp::imaging {

/// Voxels with their place in the patient. `voxels` has three dimensions ordered (k, j, i) — slice, row, column — so
/// that i runs fastest in memory; depth CV_8U … CV_64F and one channel, or three for vectors in LPS mm. The matrix is
/// always continuous and its sizes equal `geometry.size` reversed; copies share voxels as cv::Mat does.
struct Volume {
    Geometry geometry;
    cv::Mat voxels;

    Volume() = default;
    /// Allocates zeroed voxels of an OpenCV type such as CV_32FC1. Throws InvalidInput on an invalid geometry.
    Volume(const Geometry& grid, int cv_type);
    /// Adopts voxels. Throws InvalidInput when sizes disagree with the geometry or the matrix is not continuous.
    Volume(const Geometry& grid, cv::Mat data);

    [[nodiscard]] bool empty() const { return voxels.empty(); }
    [[nodiscard]] int channels() const { return voxels.channels(); }
    [[nodiscard]] Volume clone() const { return {geometry, voxels.clone()}; }
    /// The same voxels converted to another OpenCV depth, saturating.
    [[nodiscard]] Volume as(int cv_depth) const;

    /// Typed access to the first voxel; T must match the matrix type. Voxel (i, j, k) is at i + nx (j + ny k).
    template <class T>
    [[nodiscard]] T* data() { return voxels.ptr<T>(); }
    template <class T>
    [[nodiscard]] const T* data() const { return voxels.ptr<T>(); }

    /// Linear offset of a voxel in memory.
    [[nodiscard]] std::int64_t offset(int i, int j, int k) const {
        return i + std::int64_t{geometry.size[0]} * (j + std::int64_t{geometry.size[1]} * k);
    }
};

}  // namespace tissuewarp::imaging
