#pragma once
/// What one DICOM file says of each of its frames, and its pixels. GDCM and ITK give one geometry and one slope for all
/// frames of a file, and spacings of 1 mm where frames do not lie in the order of the file.

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

struct DicomFrame {
    std::optional<Eigen::Vector3d> position;          ///< LPS mm, centre of the first pixel
    std::optional<Eigen::Matrix<double, 3, 2>> axes;  ///< LPS, unit: along a row (i), along a column (j)
    std::optional<Eigen::Vector2d> spacing;           ///< mm, along i and j
    double slope = 1.0, intercept = 0.0;              ///< from stored to real values
    std::optional<double> slice_spacing;              ///< mm, as the file says: between slices, or their thickness
    std::string stack;                                ///< Stack ID, empty where there is none
    int segment = 0;                                  ///< of a segmentation, from 1
};

/// A file with pixels, without them.
struct DicomFile {
    enum class Segmentation { None, Binary, Fractional, LabelMap };

    std::filesystem::path path;
    std::string series;    ///< Series Instance UID
    std::string modality;  ///< "CT", ...
    int rows = 0, columns = 0;
    int samples = 1;         ///< a pixel: 1 grey, 3 colours
    int bits_allocated = 0;  ///< of a stored value
    int bits_stored = 0, high_bit = 0;
    bool is_signed = false;
    bool palette = false;            ///< pixels are indices of colours
    bool value_table = false;        ///< Modality LUT Sequence: values are entries of a table, not slope and intercept
    bool mosaic = false;             ///< Siemens: many slices side by side in one frame
    std::vector<DicomFrame> frames;  ///< in the order of the file
    Segmentation segmentation = Segmentation::None;
    double most_fraction = 255.0;  ///< stored value of a voxel that a segment fills
    std::map<int, std::string> segment_names;
};

/// The file's description, or nothing when it holds no pixels (plans, contours, reports). Throws IoError when it cannot
/// be read.
std::optional<DicomFile> read_dicom_file(const std::filesystem::path& path);

/// Frames × rows × columns, as stored, unpacked from any transfer syntax that is read here (plain, deflated, RLE) or by
/// GDCM (JPEG, JPEG-LS, JPEG 2000); uint8 0 or 1 for bits; float64 for uint32. Throws
/// IoError when pixels are cut short or damaged, and InvalidInput when they are of no type of grey values.
cv::Mat read_dicom_pixels(const DicomFile& file);

}  // namespace tissuewarp::imaging::detail
