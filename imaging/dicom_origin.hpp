#pragma once
/// Whose images DICOM files are: what objects that are derived from them have to repeat and to refer to.

#include <Eigen/Core>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::imaging {

/// One file of a series.
struct DicomInstance {
    std::string sop_class, sop_instance;      ///< UIDs
    std::optional<Eigen::Vector3d> position;  ///< LPS mm, centre of the first pixel; none of files of many frames
};

/// Patient, study and frame of reference of one series.
struct DicomOrigin {
    std::string frame_of_reference, study, series;  ///< UIDs
    std::map<std::uint32_t, std::string> repeated;  ///< values of patient and study by (group << 16) + element
    std::vector<DicomInstance> instances;           ///< in the order of their file names
};

/// True for a folder, and for a file that begins as DICOM files do.
bool is_dicom(const std::filesystem::path& path);

/// Of the folder of one series, or of one file. Throws IoError, or InvalidInput where there is no image or its frame of
/// reference is not stated.
DicomOrigin read_dicom_origin(const std::filesystem::path& path);

}  // namespace tissuewarp::imaging
