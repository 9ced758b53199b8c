#pragma once
/// Reading and writing image files through ITK. Every format lands in LPS mm: NIfTI-1 (.nii, .nii.gz), NRRD (.nrrd,
/// .nhdr), MetaImage (.mha, .mhd) and a folder that holds one DICOM series.

#include "imaging/volume.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::imaging {

/// A volume and what the reader had to decide or doubt (for instance sform and qform that disagree).
struct ReadResult {
    Volume volume;
    std::vector<std::string> notes;
};

/// Reads a scalar or three-component volume. Integer types wider than OpenCV's become int32 when every value fits and
/// float64 otherwise; NIfTI slope and intercept are applied.
/// Vectors in NIfTI: intent 1007 (vector) holds LPS components, as ITK and ANTs write them; intent 1006 (displacement)
/// holds RAS components, as ITK reads them from version 5.3 on, and is turned to LPS, with a note. A file of intent
/// 1006 that holds LPS components must be relabelled 1007. When sform and qform disagree, ITK's choice is taken and
/// noted. Throws IoError (missing, truncated, damaged, unreadable) or InvalidInput (2-D, one voxel thick, time series,
/// zero or infinite spacing, skewed axes, non-finite voxels, more than 2^31 values, several DICOM series, missing
/// slices).
ReadResult read_volume_with_notes(const std::filesystem::path& path);

/// As above, without the notes.
Volume read_volume(const std::filesystem::path& path);

/// Reads a label map: integer values kept exactly as int32. A floating-point file is accepted when every voxel is an
/// integer. Throws InvalidInput on fractional or negative labels.
Volume read_labels(const std::filesystem::path& path);

/// Writes in the format that the extension names, to a temporary name that is renamed when complete. Three-component
/// volumes become displacement fields: NIfTI intent 1007, LPS mm, 5-D as ANTs writes; NRRD `kinds: vector`. Compressed
/// except for .nii. Throws IoError (a full disk too); nothing half-written is left behind.
void write_volume(const Volume& volume, const std::filesystem::path& path);

}  // namespace tissuewarp::imaging
