#pragma once
/// Random organs whose deformation is known.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/evaluation.hpp"
#include "registration/intraoperative.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::study {

/// Where the truth comes from.
enum class Family {
    Solved,    ///< drawn organs; quadratic tetrahedra of tissue that the registration does not know, on a mesh of their
               ///< own
    Bent,      ///< drawn organs; a smooth map that conserves volume and solves no equation
    Labelled,  ///< organs of a real label map; such a map
    Found,     ///< organs of a real label map; a motion that another program found between images
    Resected,  ///< drawn organs without a tumour of 10 to 60 ml, whose cavity collapses; as Solved
    Opened,    ///< likewise, and a corridor leads to the cavity from outside
    Unresected,  ///< the same organs and places, the tumour in them, under the same loads from outside
    Bulged  ///< drawn organs that bulge through an opening of what holds them, where their surface is seen; as Solved
};

/// How far the organ as a whole is from where the headers put it, at most; along and about any axis.
struct Misplacement {
    double most_deg = 0, most_mm = 0;
};

/// What ultrasound shows of what the first image shows too: drawn between these for each patient.
struct EchoOptions {
    double least_own = 0.25, most_own = 0.25;  ///< log amplitude of scatterers that the first image does not show
    double least_shared = 1, most_shared = 1;  ///< of echoes from what it shows, over those of a clear sweep
    bool tracked = false;  ///< frames of a probe in a hand, compounded, with errors of tracking and calibration
};
/// As faint as real sweeps of a brain are: UltrasoundSearch explains 5 to 35 % of them.
inline constexpr EchoOptions faint_echoes{0.3, 1.0, 0.2, 0.8};

struct PhantomOptions {
    Family family = Family::Solved;
    imaging::Volume organs = {};               ///< label map whose organs are taken, where they are Labelled or Found
    std::vector<imaging::Volume> fields = {};  ///< displacements (float32, LPS mm), of which Found takes one
    double voxel_mm = 2;                       ///< of both label maps
    double boundary_deviation_mm = 0.5;        ///< of the boundaries drawn in the intraoperative map, smooth over 10 mm
    double point_deviation_mm = 0.7;           ///< of surface points and pairs, along each axis
    int targets = 150;                         ///< places all over the organ
    EchoOptions echoes = {};                   ///< of ultrasound
    std::optional<Misplacement> misplacement = {};  ///< none: what the family has, 10 or 20 degrees and mm
};

struct Ball {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    double radius_mm = 0;

    [[nodiscard]] bool holds(const Eigen::Vector3d& point) const { return (point - middle).norm() < radius_mm; }
};

/// Grey values, float32, each on a grid of its own orientation.
struct PhantomImages {
    imaging::Volume moving;
    imaging::Volume fixed;           ///< of the same contrast, with a little noise and bias
    imaging::Volume partial;         ///< the same within `view`, 0 outside
    imaging::Volume other_contrast;  ///< dark where the moving one is bright, with a little noise
    imaging::Volume degraded;        ///< of other contrast, with slices three voxels thick and much noise
    Ball view;                       ///< fixed frame; holds 35 to 70 % of the organ
    imaging::Volume cavity;          ///< uint8, grid of `fixed`: where nothing is left in the organ; empty if whole
};

/// An image before, and ultrasound during the operation.
struct PhantomUltrasound {
    imaging::Volume moving;                             ///< as of magnetic resonance, float32
    imaging::Volume fixed;                              ///< 0 outside of the fan
    std::function<bool(const Eigen::Vector3d&)> shows;  ///< whether a place (fixed frame) lies in the fan
};

/// One patient: what a registration is given, and what is true.
struct Phantom {
    std::uint64_t seed = 0;
    std::string story;                              ///< shape, tissue, what moves it, one line
    imaging::Volume moving_labels;                  ///< 0 outside, 1 organ, 2 inclusion; moving frame. Of a tumour
                                                    ///< that is resected in part 2 is what is gone, 3 what is left
    std::vector<int> resected;                      ///< of them, those whose tissue is gone
    imaging::Volume fixed_labels;                   ///< the same drawn anew in the fixed frame, with boundary noise
    registration::SurfacePoints surface;            ///< of a part of the organ's surface, fixed frame
    registration::PointPairs points;                ///< a few places in the organ
    registration::Curves curves;                    ///< vessels through it
    registration::Landmarks targets;                ///< moving and true fixed positions, LPS mm
    std::function<PhantomImages()> images;          ///< drawn when asked for: they take seconds
    std::function<PhantomUltrasound()> ultrasound;  ///< likewise
};

/// The same seed gives the same phantom, bit for bit on one machine; others round differently. Throws SolverFailure
/// where its truth does not converge.
Phantom random_phantom(std::uint64_t seed, const PhantomOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::study
