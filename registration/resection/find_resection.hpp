#pragma once
/// Tissue that has no counterpart in an image of the operation, and lies at a cavity of it.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <vector>

namespace tissuewarp::registration {

/// What a cavity looks like: fluid or air without structure, where the tissue that lies there shows some or is of
/// another grey value. Chosen on the phantoms 1 to 20 of `study coverage --problems resected:`
/// (docs/decisions/resection.md).
struct CavityOptions {
    double grid_mm = 1.5;            ///< spacing at which the images are looked at, at least
    double window_mm = 2;            ///< half the edge of the box in which an image's deviation is measured
    double most_deviation = 0.4;     ///< of the cavity over the median of the organ's tissue …
    double least_counterpart = 0.5;  ///< … and of the moving image there, likewise, or else …
    double least_difference = 3;  ///< … deviations of the fixed image from what its grey is where the moving one's is
    double least_core_ml = 0.5;   ///< smaller pieces are no cavity
    double reach_mm = 5;          ///< from what looks so to the wall, which boxes must not reach
    double opening_mm = 1.5;      ///< radius of the ball that fits into the cavity everywhere
    double least_ml = 3;          ///< less tissue without a counterpart is not said to be resected
    double surface_mm = 3;        ///< so near to the outside tissue may have sunk instead; by hand, as …
    double most_at_surface = 0.1;  ///< … the share of what is gone that lies there without a doubt
    double squeezed = 0.95;        ///< of its volume at rest: less is left of tissue that has no room …
    double squeezed_mm = 20;       ///< … so near to what is taken for gone. Both by hand
    double most_squeezed = 0.4;  ///< of what is taken for gone, that is lost so without a doubt. Chosen on *sought* 1,
                                 ///< 2, 3 and 8
};
inline constexpr CavityOptions cavity_options{};

/// The model of all tissue that is registered first only shows what is gone: coarse, by few places and few searches.
/// Chosen on the phantoms 1 to 6 of `study coverage --problems sought:` (docs/decisions/resection.md).
struct FirstLook {
    double coarser = 1.5;  ///< its edges over those of the model that is registered then
    int features = 1500;
    std::vector<int> dense_coarsening{1};
    int rounds = 4;
};

/// What it takes of the moving image.
ImageModelOptions image_of_first_look();
/// How it is registered, where a registration is done so.
UpdateOptions for_first_look(UpdateOptions options);

struct FoundResection {
    imaging::Volume gone;    ///< uint8, grid of the model's labels: labelled voxels whose tissue is gone
    imaging::Volume cavity;  ///< uint8, grid of the fixed image
    double gone_ml = 0, cavity_ml = 0;
    double at_surface_ml = 0;  ///< of what is gone: near to the outside of the organ
    double deviation = 0;      ///< of the fixed image in the core of the cavity, over the median of the organ's tissue
};

/// Looks for it with a model of all tissue that was registered to the fixed image. `gone` holds no voxel where there is
/// no cavity. Images are of one component. Throws InvalidInput, Cancelled.
FoundResection find_resection(const PreparedModel& whole, const Deformation& deformation, const imaging::Volume& moving,
                              const imaging::Volume& fixed, Observer& observer = silent_observer());

/// What speaks against a resection that was found, or none. `deformation` is that of the model without it, `gap` the
/// hole that it leaves, on the grid of the fixed image; empty where none was found.
std::vector<Doubt> doubts_of(const FoundResection& found, const Deformation& deformation, const imaging::Volume& gap);

}  // namespace tissuewarp::registration
