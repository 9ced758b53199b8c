#pragma once
/// Transforms in HDF5 as itk::HDF5TransformIO lays them out, written in pieces: ITK's own writer holds a field three
/// times, as numbers of 64 bits, and packs it on one thread (docs/decisions/transforms_out.md).

#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <cstdint>
#include <filesystem>
#include <functional>

namespace tissuewarp::registration::detail {

/// A displacement field whose vectors are asked for as they are written.
struct FieldToWrite {
    imaging::Geometry grid;
    /// Fills `vectors` with those of voxels `first` to `first` + `count` (x fastest), three components each, LPS mm. Is
    /// called from many threads.
    std::function<void(std::int64_t first, std::int64_t count, float* vectors)> vectors;
};

/// One CompositeTransform: x = after (z + field(z)), z = before y; a `before` that changes nothing is left out. The
/// components are rounded to imaging::displacement_step_mm. Throws IoError, without the name of the file.
void write_composite(const Eigen::Affine3d& before, const FieldToWrite& field, const Eigen::Affine3d& after,
                     const std::filesystem::path& path);

/// One AffineTransform. Throws IoError, without the name of the file.
void write_affine(const Eigen::Affine3d& map, const std::filesystem::path& path);

}  // namespace tissuewarp::registration::detail
