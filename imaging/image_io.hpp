#pragma once
/// Reading and writing image files. Every format lands in LPS mm: NIfTI (.nii, .nii.gz, .hdr with .img), NRRD (.nrrd,
/// .nhdr, segmentations of 3D Slicer), MetaImage (.mha, .mhd), a folder that holds one DICOM series, one DICOM file of
/// many frames, and DICOM contours.

#include "imaging/field_type.hpp"
#include "imaging/label_names.hpp"
#include "imaging/volume.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::imaging {

/// A volume, and what the reader had to decide or doubt (for instance sform and qform that disagree).
struct ReadResult {
    Volume volume;
    std::vector<std::string> notes;
    LabelNames label_names;  ///< of a segmentation that names its segments (.seg.nrrd, DICOM SEG)
};

/// True where the name is of an image (in any case), or the file begins as DICOM files do, or it is a folder.
bool is_image(const std::filesystem::path& path);

/// Reads a scalar or three-component volume. Every voxel is read from the file: files that are cut short, lists of
/// slices that do not fit the header, and damaged packed data are refused. Integer types wider than OpenCV's become
/// int32 when every value fits and float64 otherwise; slope and intercept are applied. Units of length become mm, those
/// of vectors too, with a note where they were others. Layers of a segmentation become one label map; overlaps are
/// refused. Vectors in NIfTI: intent 1007 (vector) holds LPS components, as ITK and ANTs write them; intent 1006
/// (displacement) holds RAS components, as ITK reads them from version 5.3 on, and is turned to LPS, with a note. A
/// file of intent 1006 that holds LPS components must be relabelled 1007. Vectors in NRRD are turned from the header's
/// space to LPS. When sform and qform disagree, ITK's choice is taken and noted. Throws IoError (missing, truncated,
/// damaged, unreadable) or InvalidInput (2-D, one voxel thick, time series, zero or infinite spacing, unknown units,
/// skewed axes, non-finite voxels, more than 2^31 values, several DICOM series, missing or tilted slices, frames
/// without positions).
ReadResult read_volume_with_notes(const std::filesystem::path& path);

/// As above, without the notes.
Volume read_volume(const std::filesystem::path& path);

/// Reads a label map: integer values kept exactly as int32. A floating-point file is accepted when every voxel is an
/// integer. Throws InvalidInput on fractional or negative labels, and on a grey image.
ReadResult read_labels_with_notes(const std::filesystem::path& path);

/// True for a DICOM structure set (RTSTRUCT): contours, which have no voxels of their own. read_labels() draws them on
/// pixels of 1 mm in their planes.
bool is_structure_set(const std::filesystem::path& path);

/// Labels of a structure set on the voxels of an image.
ReadResult read_structures_on(const std::filesystem::path& path, const Geometry& image);

/// As above, without the notes.
Volume read_labels(const std::filesystem::path& path);

/// The image as a label map, under the conditions of `read_labels`. `path` stands for it in messages.
ReadResult as_labels(ReadResult image, const std::filesystem::path& path);

/// Writes in the format that the extension names, to a temporary name that is renamed when complete. Three-component
/// volumes become displacement fields: NIfTI intent 1007, LPS mm, 5-D as ANTs writes; NRRD `kinds: vector`. Compressed
/// except for .nii. Throws IoError (a full disk too); nothing half-written is left behind.
void write_volume(const Volume& volume, const std::filesystem::path& path);

/// Steps that the components of written displacements take: a whole power of two, which leaves bits of float32 zero,
/// and an error of a micrometre at most.
inline constexpr double displacement_step_mm = 1.0 / 512;

/// The nearest whole steps. `field` has float32 voxels.
Volume rounded(const Volume& field, double step);

/// As write_volume(), the components rounded to displacement_step_mm; NRRD also gets the key `displacement field type`,
/// by which 3D Slicer (from September 2025 on) takes the direction. Other formats have no place for it: programs take
/// them for resampling. Throws InvalidInput unless there are three components of float32.
void write_displacement_field(const Volume& field, const std::filesystem::path& path, FieldType type);

/// What an NRRD file says of its field's direction; nothing where it says nothing, and of other formats. Throws IoError
/// on a damaged header and InvalidInput on another word than the two.
std::optional<FieldType> stated_field_type(const std::filesystem::path& path);

}  // namespace tissuewarp::imaging
