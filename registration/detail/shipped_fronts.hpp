#pragma once
/// fronts.json of `tissuewarp calibrate` on two cores of a server without GPU.

namespace tissuewarp::registration::detail {

extern const char* const shipped_fronts_text;

}  // namespace tissuewarp::registration::detail
