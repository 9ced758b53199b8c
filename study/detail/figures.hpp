#pragma once
/// The two figures of a problem, as SVG: errors over time, and errors over meshes and tolerances.

#include "study/findings.hpp"

#include <string>

namespace tissuewarp::study::detail {

/// All settings, the front, the base and the knee; dashed, errors of round numbers, or how well the reference is known.
std::string front_figure(const ProblemSummary& problem, const Findings& findings);

/// Lines of equal error and of equal time over elements and tolerance; empty where the points make no grid of at least
/// two of each.
std::string grid_figure(const ProblemSummary& problem, const Findings& findings);

}  // namespace tissuewarp::study::detail
