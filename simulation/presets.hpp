#pragma once
/// Tissues by name, each with the publication that measured it and what is a choice of ours.

#include "tled/material.hpp"
#include "tled/viscosity.hpp"

#include <string>
#include <vector>

namespace tissuewarp::simulation {

struct Preset {
    std::string name;
    tled::Material material;
    tled::PronySeries viscosity;
    std::string source;  ///< publication and the figures taken from it
    std::string choice;  ///< what it does not say
};

const std::vector<Preset>& presets();

/// Throws InvalidInput for an unknown name.
const Preset& preset(const std::string& name);

}  // namespace tissuewarp::simulation
