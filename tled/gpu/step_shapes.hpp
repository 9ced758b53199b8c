#pragma once
/// Sizes of patches that decide the suggested shapes of GPU steps.

#include "tled/model.hpp"

namespace tissuewarp::tled::detail {

/// Of an H100, where the suggested shapes were measured; taken where a device does not say how many it has.
inline constexpr int default_multiprocessors = 132;

/// Tetrahedra of a patch that is worth a workgroup.
inline constexpr int least_patch_tets = 64;

/// Tetrahedra of a patch whose nodes fit into 48 kB of shared memory: 36 B each, 44 with averaged pressure.
constexpr int largest_patch_tets(Element element) {
    return element == Element::T4 ? 4450 : 3600;
}

}  // namespace tissuewarp::tled::detail
