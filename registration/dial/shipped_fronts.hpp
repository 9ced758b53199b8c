#pragma once
/// fronts.json of `tissuewarp calibrate` with eight phantoms (5001–5008), each on two cores of their own of one Xeon
/// with AVX-512, merged by scripts/merge_fronts.py.

namespace tissuewarp::registration::detail {

extern const char* const shipped_fronts_text;

}  // namespace tissuewarp::registration::detail
