#pragma once
/// A cube of soft tissue, standing on its lower side, that the tests of this folder load.

#include "simulation/build.hpp"
#include "simulation/loads.hpp"
#include "simulation/run.hpp"

namespace tissuewarp::simulation::test {

/// Edge 100 mm, `cells`³ cells, Young's modulus 3 kPa, Poisson's ratio 0 unless given, sets "below" and "above".
inline Scene cube(int cells = 4, double poisson_ratio = 0.0) {
    Scene scene;
    scene.title = "cube";
    scene.geometry = BoxGeometry{Eigen::Vector3d::Zero(), {100, 100, 100}, {cells, cells, cells}};
    scene.tissues[1].material = tled::neo_hookean_lnj(3.0, poisson_ratio);
    scene.sets["below"].side = Side{2, false, 0.0};
    scene.sets["above"].side = Side{2, true, 0.0};
    scene.fixed.push_back({"below", {false, false, true}});
    scene.solve.device = Device::Cpu;
    scene.solve.tolerance_mm = 1e-3;
    return scene;
}

/// Held against sliding and turning on its lower side, where that does not resist its widening.
inline void stand_freely(Scene& scene) {
    scene.sets["corner"].box = Box{{-1, -1, -1}, {1, 1, 1}};
    scene.sets["edge"].box = Box{{99, -1, -1}, {101, 1, 1}};
    scene.fixed.push_back({"corner", {true, true, false}});
    scene.fixed.push_back({"edge", {false, true, false}});
}

}  // namespace tissuewarp::simulation::test
