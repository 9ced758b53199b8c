/// The verification cases of whole scenes; the test itself is that of effect_cases_test.cpp.
#include "tests/verification/effect_engines.hpp"

namespace tissuewarp::verification {

INSTANTIATE_TEST_SUITE_P(Scenes, Effects,
                         ::testing::Combine(::testing::ValuesIn(all_engines), ::testing::ValuesIn(scene_cases())),
                         name_of_effect);

}  // namespace tissuewarp::verification
