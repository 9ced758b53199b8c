// The shortest use of the solver: a block, held below and drawn up by a tenth of its height.

#include <tissuewarp/meshing/primitives.hpp>
#include <tissuewarp/tled/engine.hpp>
#include <tissuewarp/tled/equilibrium.hpp>

#include <cmath>
#include <cstdio>

using namespace tissuewarp;

int main() {
    tled::Model model;
    model.mesh = meshing::box_mesh({40, 40, 40}, {4, 4, 4});
    model.materials[1] = tled::neo_hookean_lnj(3.0, 0.45);
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions conditions;
    for (int node = 0; node < model.mesh.node_count(); ++node) {
        const double z = model.mesh.nodes(2, node);
        if (z == 0) conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        if (z == 40) conditions.prescribed.push_back({node, {false, false, true}, {0, 0, 4}});
    }
    const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest.node_count);
    const auto engine = tled::make_cpu_engine(rest, tled::Scalar::Float32);
    const auto solved = tled::equilibrium(*engine, tled::RestStiffness(rest, nodal), nodal, {});
    const double middle = solved.displacement(2, 62);  // of the block, nearer to the clamped end: under 2 mm
    std::printf("the middle of the block went up by %.3f mm, %d evaluations\n", middle, solved.force_evaluations);
    return std::abs(middle - 1.64) < 0.1 ? 0 : 1;
}
