#pragma once
/// Checks on image files before a reader allocates or trusts anything: the header's sizes and spacing, and whether the
/// file holds as many bytes as the header promises. ITK replaces a zero spacing by 1 and fills some missing bytes by 0.

#include <filesystem>

namespace tissuewarp::imaging::detail {

enum class Format { Nifti, Nrrd, MetaImage };

/// Throws InvalidInput on a size or spacing that is no volume's, on more than 2^33 voxels, and IoError on a file that
/// is cut short. What only the format's own reader knows (rare encodings, lists of files) is left to it.
void require_sound_file(const std::filesystem::path& path, Format format);

}  // namespace tissuewarp::imaging::detail
