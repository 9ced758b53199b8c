#pragma once
/// The problems of data/reference, one source file each in problems/.

#include "tests/verification/problem.hpp"

#include <optional>
#include <vector>

namespace tissuewarp::verification {

/// The seed method's cube between bonded plates (p1): pulled by 20 %. One eighth, graded towards plates and sides.
Problem cube_stretch(Law law);
/// The same pressed by 15 % and by 30 % (p2).
Problem cube_mild_compression(Law law);
Problem cube_compression(Law law);
/// Its top moved sideways by 50 % (p2). One half.
Problem cube_shear(Law law);

/// Cook's membrane (p4) with ν of 0.3, 0.45, 0.49, 0.499 or 0.4999: plane strain, and 3D where the file holds the law.
Problem cook_plane_strain(Law law, double nu);
std::optional<Problem> cook_3d(Law law, double nu);

/// Square bar turned by 180°; cantilever under its weight (p5).
Problem bar_twist(Law law);
Problem cantilever(Law law);

/// Ellipsoid pressed by 10 mm; the same with a ball 20 times stiffer, isochoric law (p6).
Problem ellipsoid_plain(Law law);
Problem ellipsoid_inclusion();

/// Half ball hanging from or lying on its flat face (p7).
enum class Gravity { Prone, Supine };
Problem breast(Law law, Gravity gravity);

/// Half ball pressed by a rigid frictionless plane; `step` counts the depths of the file, from 0.005 R to 0.3 R (p9).
Problem half_ball_contact(Law law, int step);
/// Block between two such planes, compressed by 5, 10, 20, 30 % (p9).
Problem block_contact(Law law, int step);

/// All of these, both laws where the files hold them.
std::vector<Problem> all_problems();

}  // namespace tissuewarp::verification
