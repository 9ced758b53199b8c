#pragma once
/// Random organs whose deformation is known: made with quadratic tetrahedra and tissue that the registration does not
/// know, on a mesh of their own.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/evaluation.hpp"
#include "registration/intraoperative.hpp"

#include <cstdint>
#include <string>

namespace tissuewarp::study {

struct PhantomOptions {
    double voxel_mm = 2;                 ///< of both label maps
    double boundary_deviation_mm = 0.5;  ///< of the boundaries drawn in the intraoperative map, smooth over 10 mm
    double point_deviation_mm = 0.7;     ///< of surface points and pairs, along each axis
    int targets = 150;                   ///< places all over the organ
};

/// One patient: what a registration is given, and what is true.
struct Phantom {
    std::uint64_t seed = 0;
    std::string story;                    ///< shape, tissue, what moves it, one line
    imaging::Volume moving_labels;        ///< 0 outside, 1 organ, 2 inclusion; moving frame
    imaging::Volume fixed_labels;         ///< the same drawn anew in the fixed frame, with boundary noise
    registration::SurfacePoints surface;  ///< of a part of the organ's surface, fixed frame
    registration::PointPairs points;      ///< a few places in the organ
    registration::Landmarks targets;      ///< moving and true fixed positions, LPS mm
};

/// The same seed gives the same phantom, bit for bit on one machine; others round differently. Throws SolverFailure
/// where its truth does not converge.
Phantom random_phantom(std::uint64_t seed, const PhantomOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::study
