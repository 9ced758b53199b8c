#pragma once
/// Damage to HDF5 files by HDF5 itself: what its own checks let through.

#include "tests/fuzz/format.hpp"

namespace tissuewarp::fuzz {

/// Other values in a dataset, a dataset gone, under another's name, or of another shape or type. False where none was.
bool edit_hdf5(const std::filesystem::path& file, Random& random);

}  // namespace tissuewarp::fuzz
