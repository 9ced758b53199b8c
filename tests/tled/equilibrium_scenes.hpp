#pragma once
/// What equilibria are tested on.

#include "meshing/primitives.hpp"
#include "tled/equilibrium.hpp"

#include <cmath>
#include <string>
#include <vector>

namespace tissuewarp::tled {

inline double largest_difference(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
    return std::sqrt((a - b).colwise().squaredNorm().maxCoeff());
}

/// Cube of 100 mm, λ = 49.329 kPa, μ = 1.007 kPa, ends bonded, one pulled by 20 mm.
struct SeedCube {
    Model model;
    RestState rest;
    NodalConditions conditions;

    explicit SeedCube(Element element, int cells = 8) {
        model.mesh = meshing::box_mesh({100, 100, 100}, {cells, cells, cells});
        model.materials[1] = NeoHookeanLnJ{1.007, 49.329};
        model.element = element;
        rest = rest_state(model);
        Conditions bonded;
        for (int node = 0; node < model.mesh.node_count(); ++node) {
            const double z = model.mesh.nodes(2, node);
            if (z < 1e-9) bonded.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
            if (z > 100 - 1e-9) bonded.prescribed.push_back({node, {true, true, true}, {0, 0, 20}});
        }
        conditions = nodal_conditions(bonded, rest.node_count);
    }
};

/// Keeps what it is told.
struct Listener : Observer {
    std::vector<std::string> notes;
    void note(std::string_view message) override { notes.emplace_back(message); }
};

}  // namespace tissuewarp::tled
