#pragma once
/// Tissues by name: what registrations take for them.

#include "registration/options.hpp"
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
    /// TissuePrior::expected_strain and BlockMatchingOptions::search_mm. Of lungs chosen on synthetic breaths 1 to 8
    /// from images (docs/decisions/large_motion.md).
    double expected_strain = TissuePrior().expected_strain, search_mm = BlockMatchingOptions().search_mm;
    std::string source;  ///< of the moduli
};

/// All of them, the default first.
const std::vector<Tissue>& tissues();

/// Throws InvalidInput that lists the names where there is none of this one.
const Tissue& tissue_named(const std::string& name);

/// What registrations of an organ of this tissue expect of its motion.
void expect_motion_of(const Tissue& tissue, UpdateOptions& options);

}  // namespace tissuewarp::registration
