#pragma once
/// Magnetic resonance before, and ultrasound during an operation.

#include "study/detail/random.hpp"
#include "study/detail/true_tissue.hpp"
#include "study/phantom.hpp"

namespace tissuewarp::study::detail {

/// An organ with folds, vessels and an inclusion. Its echoes are those of its interfaces (folds, walls of vessels,
/// surfaces; weaker where the beam grazes them, or of what the other image shows as a gradient along the beam) and of
/// scatterers, whose density depends on the tissue in another way than the other image's grey value, and partly on
/// something else.
PhantomUltrasound drawn_ultrasound(const TrueTissue& tissue, const EchoOptions& options, Random& random);

}  // namespace tissuewarp::study::detail
