#pragma once
/// Measuring what meshes cost and give on this machine.

#include "core/observer.hpp"
#include "registration/dial/dial.hpp"
#include "registration/update.hpp"

#include <cstdint>
#include <vector>

namespace tissuewarp::study {

struct FrontsPlan {
    std::vector<std::uint64_t> seeds{5001, 5002, 5003, 5004, 5005, 5006, 5007, 5008};  ///< of random_phantom
    std::vector<double> edges_per_organ{6, 8, 10, 12, 15, 18, 22};
    std::vector<double> voxel_mm{2.0, 1.25};  ///< two sizes, for the costs that grow with images
    registration::UpdateOptions update;
};

/// Registers every phantom with labels, and with its surface points and pairs, with every mesh; a few minutes. Throws
/// InvalidInput for an empty plan, Cancelled.
registration::Fronts measure_fronts(const FrontsPlan& plan, Observer& observer = silent_observer());

}  // namespace tissuewarp::study
