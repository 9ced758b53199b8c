#pragma once
/// How well the moving image explains the echoes about places of a grid, shifted by every step of a lattice: the local
/// linear combination of intensity and gradient magnitude (LC2; Wein et al., MICCAI 2013).

#include "registration/matching/ultrasound/echo_images.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::registration::detail {

struct EchoCostOptions {
    double window_mm = 6;      ///< deviation of the Gaussian window about a place
    int reach = 3;             ///< voxels: shifts of up to this along each axis
    int stride = 2;            ///< voxels between places
    double least_share = 0.3;  ///< of a place's window, that the ultrasound must show
    double most_lost = 0.4;    ///< of what it shows, that may have no like in the moving image
    double ridge = 0.02;       ///< of the regression, in variances of what explains
};

/// A cost is the share of the echoes' variance in the window about a place that no linear combination of what the
/// moving image shows at a shift explains, 0..1: 1 − LC2.
struct EchoCosts {
    imaging::Geometry places;         ///< the grid of the places, of which some are not looked at
    double step_mm = 1;               ///< of the lattice of shifts, along the axes of the grid
    int reach = 0;                    ///< in steps
    std::vector<std::size_t> at;      ///< places that are looked at
    std::vector<float> cost;          ///< of each of them, the lattice, i fastest; infinity where too little is shown
    std::vector<float> window_share;  ///< of each of them: of its window that is seen

    [[nodiscard]] int side() const { return 2 * reach + 1; }
    [[nodiscard]] std::size_t lattice() const {
        return static_cast<std::size_t>(side()) * static_cast<std::size_t>(side()) * static_cast<std::size_t>(side());
    }
    [[nodiscard]] const float* of(std::size_t n) const { return cost.data() + n * lattice(); }
    /// LPS mm, moving frame.
    [[nodiscard]] Eigen::Vector3d place(std::size_t n) const;
    /// Steps, of an entry of the lattice. Tissue that is at X belongs where the ultrasound is seen at X + shift.
    [[nodiscard]] Eigen::Vector3i shift(std::size_t entry) const;
};

/// Threads do not change the result.
EchoCosts echo_costs(const EchoImages& images, const EchoCostOptions& options);

}  // namespace tissuewarp::registration::detail
