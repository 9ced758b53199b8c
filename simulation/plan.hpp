#pragma once
/// What a built scene will run: which effects, on how much of the tissue, and what a step costs by counting.

#include "simulation/build.hpp"

#include <string>
#include <vector>

namespace tissuewarp::simulation {

/// By counting, for a step of the whole model: at least what a cache of any size leaves to memory, and additions and
/// multiplications with a division, root or logarithm as ten (tled/step_work.hpp).
struct Work {
    double bytes = 0;
    double flops = 0;
};

struct PlannedEffect {
    std::string name;    ///< "gravity", "pressure", …
    std::string detail;  ///< what it acts on
    Work work;           ///< besides that of the elements; none for what is part of the nodes' constant force
};

struct Plan {
    int nodes = 0, tetrahedra = 0, outer_faces = 0;
    std::string element;                 ///< "linear tetrahedra", "linear tetrahedra with averaged pressure"
    std::vector<std::string> laws;       ///< "label 1, brain: ogden, viscous with 2 terms"
    Work cpu, gpu;                       ///< of the elements, as if all were neo-Hookean
    std::vector<PlannedEffect> effects;  ///< that the scene has, and no other
    double memory = 0;                   ///< bytes of the arrays of a float32 engine, grids of obstacles included
    double time_step = 0;                ///< s, a bound from below of the one that dynamics finds; 0 for equilibria
};

Plan plan_of(const BuiltScene& built);

}  // namespace tissuewarp::simulation
