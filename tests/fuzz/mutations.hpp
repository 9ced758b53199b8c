#pragma once
/// Damage to files, as disks, editors and other programs do it and worse.

#include "tests/fuzz/format.hpp"

namespace tissuewarp::fuzz {

/// One to four changes of one file of the seed, rarely of two. `seeds` are all of the format: pieces of others are put
/// in.
Seed damaged(const Format& format, const std::vector<Seed>& seeds, Random& random);

}  // namespace tissuewarp::fuzz
