#pragma once
/// Tissues by name: what registrations take for them.

#include "tled/material.hpp"

#include <string>
#include <vector>

namespace tissuewarp::registration {

/// A tissue that a user may name.
struct Tissue {
    std::string name;
    tled::Material material;  ///< kPa; only ratios between tissues of one model tell
    /// Largest |logarithm| of a stretch that an organ of it takes up as a whole without strain, along any axis: air
    /// leaves a lung. 0: every change of shape strains it.
    double free_stretch = 0;
    double most_growth = 1;  ///< factor by which its volume may grow, or one over it shrink
    std::string source;      ///< of the moduli
};

/// All of them, the default first.
const std::vector<Tissue>& tissues();

/// Throws InvalidInput that lists the names where there is none of this one.
const Tissue& tissue_named(const std::string& name);

}  // namespace tissuewarp::registration
