#pragma once
/// The one place that hands images to ITK and takes them from it.

#include "imaging/detail/file_layout.hpp"
#include "imaging/volume.hpp"

namespace tissuewarp::imaging::detail {

/// Reads one file that `require_sound_file` let pass. Vectors come as stored. Throws IoError or InvalidInput.
Volume read_through_itk(const std::filesystem::path& path, Format format);

/// Writes one file of a format; NRRD and MetaImage are compressed, NIfTI (.nii) is not. Throws IoError. The caller
/// checks that the file is whole: ITK does not notice a full disk.
void write_through_itk(const Volume& volume, const std::filesystem::path& path, Format format);

}  // namespace tissuewarp::imaging::detail
