#pragma once
/// DICOM structure sets (RT Structure Set, PS3.3 C.8.8.5 and C.8.8.6): regions drawn as closed contours in parallel
/// planes, and the label map that they stand for.

#include "imaging/image_io.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

struct ContouredRegion {
    int number = 0;  ///< ROI Number
    std::string name;
    std::vector<Eigen::Matrix3Xd> contours;  ///< closed, 3 × points, LPS mm
};

struct StructureSet {
    std::vector<ContouredRegion> regions;  ///< those with contours
    std::vector<std::string> notes;        ///< what was left out
};

/// Nothing where the file is no structure set. Regions that are no tissue by their type (outline of the patient,
/// volumes of a plan, marks) are left out, with a note. Throws IoError when it is damaged, InvalidInput when it holds
/// no closed contour.
std::optional<StructureSet> read_structure_set(const std::filesystem::path& path);

/// Labels are the regions' numbers. A voxel is within a region where its centre is within an odd number of contours of
/// its plane, so that contours within contours are holes. Between two planes of a region the mean of the signed
/// distances to the contours of both, weighed by nearness, decides (Raya and Udupa, IEEE TMI 9 (1990) 32); steps of
/// more than 2.5 times the region's usual one are gaps. Voxels are those of `image`, if given; without one, or where
/// its slices are not parallel to the contours, labels are drawn on pixels of 1 mm in the contours' planes. Where one
/// region holds nineteen twentieths of a smaller one (a tumour in an organ), or at most one (a rim), the voxels that
/// they share go to the smaller, with a note. Throws InvalidInput on other overlaps, by name, on contours that are not
/// in parallel planes, and on extents of no patient.
ReadResult labels_of(const StructureSet& set, const std::filesystem::path& path, const Geometry* image);

}  // namespace tissuewarp::imaging::detail
