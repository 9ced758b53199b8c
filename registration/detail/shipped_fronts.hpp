#pragma once
/// fronts.json of `tissuewarp calibrate --quick` on two busy cores: two phantoms, two meshes.

namespace tissuewarp::registration::detail {

extern const char* const shipped_fronts_text;

}  // namespace tissuewarp::registration::detail
