#pragma once
/// One of the transforms that a file of ITK holds.

#include "registration/io/point_map.hpp"

#include <string>
#include <vector>

namespace tissuewarp::registration::detail {

struct ItkTransform {
    std::string type;  ///< AffineTransform_double_3_3
    std::vector<double> parameters, fixed;
};

/// In the order of the file, which applies the last one first (itk::CompositeTransform). `path` stands in messages.
/// Throws InvalidInput on types that are not read, on parameters that do not fit them and on two fields.
PointMap composed(const std::vector<ItkTransform>& transforms, const std::filesystem::path& path);

/// The transforms of an .h5 file. Throws IoError.
std::vector<ItkTransform> read_itk_hdf5(const std::filesystem::path& path);

}  // namespace tissuewarp::registration::detail
