#pragma once
/// The problems of data/reference, one source file each in problems/.

#include "tests/verification/problem.hpp"

#include <vector>

namespace tissuewarp::verification {

/// The seed method's cube between bonded plates (p1): pulled by 20 %. One eighth, graded towards plates and sides.
Problem cube_stretch(Law law);
/// The same pressed by 15 % and by 30 % (p2).
Problem cube_mild_compression(Law law);
Problem cube_compression(Law law);
/// Its top moved sideways by 50 % (p2). One half.
Problem cube_shear(Law law);

}  // namespace tissuewarp::verification
