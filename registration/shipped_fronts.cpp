#include "registration/detail/shipped_fronts.hpp"

namespace tissuewarp::registration::detail {

const char* const shipped_fronts_text = R"json({}
)json";

}  // namespace tissuewarp::registration::detail
