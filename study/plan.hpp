#pragma once
/// Which settings a study measures: one thing at a time about a base, and meshes against tolerances.

#include "study/problem.hpp"

#include <string>
#include <vector>

namespace tissuewarp::study {

enum class Extent {
    Quick,  ///< whether the study runs, and the shape of its fronts: seconds
    Full    ///< hours on two cores
};

struct PlanOptions {
    Extent extent = Extent::Full;
    int most_elements = 500000;  ///< larger meshes are left out
    /// The first is the base's; others get the sizes of meshes, a GPU up to a million elements.
    std::vector<tled::Processor> processors{tled::Processor::Cpu};
};

/// The setting that others differ from.
Setting base_of(const Problem& problem, const PlanOptions& options);

/// Every setting once, the base among them, those that share preparations side by side, small meshes first. Settings
/// that the problem refuses are left out.
std::vector<Setting> plan(const Problem& problem, const PlanOptions& options);

/// In what a setting differs from the base: "base", "elements", "tolerance", "elements and tolerance", "element",
/// "law", "Poisson's ratio", "hold", "solver", "arithmetic", "processor" (with or without another mesh), or "several".
std::string factor_of(const Setting& setting, const Setting& base);

}  // namespace tissuewarp::study
