#pragma once
/// Sweeps of a tracked ultrasound probe, as Plus and 3D Slicer write them ("sequence metafile"): a MetaImage whose
/// third axis counts frames, and for each of them transforms between coordinate systems ("ProbeToReference") and
/// whether they are to be believed. Plus Toolkit, user manual: "Sequence file", "Ultrasound image orientation".

#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::imaging {

enum class Axes { RAS, LPS };

struct SweepOptions {
    std::string to = "Reference";  ///< the coordinate system, mm, in which the patient lies
    Axes axes = Axes::RAS;         ///< of that system
    /// From pixels (column, row, 0) to mm of the probe, where the file does not say it.
    std::optional<Eigen::Affine3d> image_to_probe;
};

struct SweepFrame {
    int slice = 0;               ///< of the pixels
    Eigen::Affine3d to_patient;  ///< (column, row, mm along the normal) → LPS mm
    [[nodiscard]] Eigen::Vector3d normal() const { return to_patient.linear().col(2); }
};

struct Sweep {
    cv::Mat pixels;                            ///< frames × rows × columns, of 8 or 16 bits without sign
    std::vector<SweepFrame> frames;            ///< those whose place is known
    std::vector<std::filesystem::path> files;  ///< that hold the pixels
    std::vector<std::string> notes;

    [[nodiscard]] int rows() const { return pixels.size[1]; }
    [[nodiscard]] int columns() const { return pixels.size[2]; }
};

/// From pixels to mm of the probe: 16 numbers in four rows, or the transform from Image to Probe in a configuration of
/// Plus (XML). Throws IoError, and InvalidInput where there is none.
Eigen::Affine3d read_calibration(const std::filesystem::path& path);

/// Frames whose image or transforms are not OK are left out, and those far from all others, with notes. Throws IoError
/// on a damaged file, and InvalidInput on what is no sweep, no brightness, tells no way from the image to `to`, or has
/// pixels (0.005 to 2 mm) or frames (500 mm) whose size no probe has.
Sweep read_sweep(const std::filesystem::path& path, const SweepOptions& options = {});

}  // namespace tissuewarp::imaging
