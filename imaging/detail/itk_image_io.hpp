#pragma once
/// The one place that hands images to ITK, for writing.

#include "imaging/detail/image_header.hpp"
#include "imaging/field_type.hpp"
#include "imaging/volume.hpp"

#include <optional>

namespace tissuewarp::imaging::detail {

/// Writes one file of a format; NRRD and MetaImage are compressed, NIfTI (.nii) is not. Throws IoError. The caller
/// checks that the file is whole: ITK does not notice a full disk. A type goes into NRRD headers alone.
void write_through_itk(const Volume& volume, const std::filesystem::path& path, Format format,
                       std::optional<FieldType> type = {});

}  // namespace tissuewarp::imaging::detail
