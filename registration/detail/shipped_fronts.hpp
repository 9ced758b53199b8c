#pragma once
/// fronts.json of `tissuewarp calibrate` with seven phantoms (5001–5005, 5007, 5008), each on two cores of their own of
/// one Xeon with AVX-512; medians and percentiles over the phantoms. What a voxel of a field takes is from one of them
/// (5002) on a busier machine. Rounds from labels were measured before relaxation without solves, and take a fifth now.

namespace tissuewarp::registration::detail {

extern const char* const shipped_fronts_text;

}  // namespace tissuewarp::registration::detail
