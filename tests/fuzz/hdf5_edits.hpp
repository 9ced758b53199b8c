#pragma once
/// Damage to HDF5 files by HDF5 itself: what its own checks let through.

#include "tests/fuzz/format.hpp"

namespace tissuewarp::fuzz {

/// Other values in a dataset, a dataset gone, under another's name, or of another shape or type. False where none was.
bool edit_hdf5(const std::filesystem::path& file, Random& random);

/// The same objects in a file without a seal, as older versions of the program wrote them, or, with `checked`, with the
/// checksums of HDF5 1.8, as ITK does.
void copy_without_seal(const std::filesystem::path& from, const std::filesystem::path& to, bool checked);

}  // namespace tissuewarp::fuzz
