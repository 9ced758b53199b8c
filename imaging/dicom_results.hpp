#pragma once
/// DICOM objects that a registration leaves: the deformation, label maps as contours, and maps of a quantity.

#include "imaging/dicom_origin.hpp"
#include "imaging/label_names.hpp"
#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <filesystem>
#include <string>

namespace tissuewarp::imaging {

/// Writes a Deformable Spatial Registration (PS3.3, A.39.2): points y of the registered frame of reference, which is
/// that of the fixed series, are found at after (y + displacement(y)) in the moving series (C.20.3.1.1). `displacement`
/// has three float32 components, LPS mm, on a grid of the fixed frame. Complete or absent. Throws IoError.
void write_deformable_registration(const Volume& displacement, const Eigen::Isometry3d& after, const DicomOrigin& fixed,
                                   const DicomOrigin& moving, const std::filesystem::path& path);

/// Writes a structure set (RTSTRUCT, PS3.3, A.19): one region a label, named where it has a name, by closed contours in
/// the slices of the map, which refer to the images of the series that lie there. A contour within another is a hole.
/// `labels` is int32. Complete or absent. Throws IoError, and InvalidInput for a map without labels.
void write_structure_set(const Volume& labels, const LabelNames& names, const DicomOrigin& origin,
                         const std::filesystem::path& path);

/// What the values of a map are, by codes of PS3.16 or UCUM.
struct MapQuantity {
    std::string description;                    ///< of the series
    std::string unit, unit_meaning;             ///< UCUM: "mm", "millimeter"
    std::string code, code_scheme, code_title;  ///< of the quantity
};

/// Writes a Parametric Map (PS3.3, A.75) of float32, a series of one object whose frames are the slices of the map.
/// NaN becomes -1, the padding value. `map` has one component. Complete or absent. Throws IoError.
void write_parametric_map(const Volume& map, const MapQuantity& quantity, const DicomOrigin& origin,
                          const std::filesystem::path& path);

}  // namespace tissuewarp::imaging
