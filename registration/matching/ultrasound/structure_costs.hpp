#pragma once
/// How alike the structure of the echoes and of the moving image is about places of a grid, the one shifted by every
/// step of a lattice: descriptors of self-similarity (Heinrich et al., MICCAI 2013), summed up over a window. Where a
/// linear combination explains next to nothing, the shape of what is seen still tells where it lies.

#include "registration/matching/ultrasound/shifted_windows.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

/// Chosen on `study coverage --problems faint-ultrasound:1-24` (docs/decisions/ultrasound.md).
struct StructureCostOptions {
    double window_mm = 9;      ///< deviation of the Gaussian window about a place
    int step = 2;              ///< voxels from one that is compared to the next, and from shift to shift
    int reach = 6;             ///< steps: shifts of up to this along each axis
    int stride = 2;            ///< steps between places
    double least_share = 0.3;  ///< as EchoCostOptions
    double most_lost = 0.4;    ///< likewise
};

/// As wide as what one instruction compares; beyond the channels 0.
using StructureDescriptor = std::array<std::uint8_t, 16>;

/// What is compared: every few voxels of both images, and their descriptors.
struct Structure {
    EchoImages images;  ///< no gradient, and no grey value
    std::vector<StructureDescriptor> echo, moving;
};
Structure structure_of(const EchoImages& images, int step);

ShiftedWindows windows_of(const StructureCostOptions& options);

/// A cost is the mean difference of descriptors in the window about a place, 0..1. Threads do not change the result.
EchoCosts structure_costs(const EchoImages& images, const StructureCostOptions& options);

}  // namespace tissuewarp::registration::detail
