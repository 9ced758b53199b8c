#pragma once
/// Tissue that the model has and an image of the operation shows nothing of, though nobody said that it is gone.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"
#include "registration/matching/points/field_of_view.hpp"
#include "registration/resection/tissue_cubes.hpp"
#include "registration/result.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace tissuewarp::registration::detail {

struct TissueGoneOptions {
    /// Correlation of both images in a piece, from which on it is tissue that the fixed one shows with little contrast.
    /// Chosen on `study coverage --problems untold:` and `unresected:1-10`: 0.12 and less in cavities, 0.4 and more in
    /// tumours.
    double least_likeness = 0.25;
};
inline constexpr TissueGoneOptions tissue_gone_options{};

struct TissueGone {
    double ml = 0;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< middle of the largest piece, LPS mm
};

/// What of the deformed model lies, in view, where the fixed image has no structure and the moving one has: cavities of
/// fluid or air, by the same rule as find_resection(), looked for in the moving frame, so that no field is inverted; so
/// is the place. Looked for only where `cubes`, of the moving image, say that there may be some. Images are of one
/// component.
TissueGone tissue_gone(const TissueCubes& cubes, const Deformation& deformation, const imaging::Volume& moving,
                       const imaging::Volume& fixed, const FieldOfView& view);

struct UnlabelledOptions {
    double half_mm = 2.5;  ///< a cube of twice that fits into all that counts: boundaries are drawn a voxel off. Chosen
                           ///< by hand; cavities of 10 ml that collapse to a third hold one
};
inline constexpr UnlabelledOptions unlabelled_options{};

/// The same by two label maps (int32) on a grid of the fixed image: what a model shows, and those that were given,
/// which hold nothing there. Labels that these lack altogether do not count.
TissueGone tissue_unlabelled(const imaging::Volume& shown, const imaging::Volume& fixed_labels);

/// `resected.untold` from CavityOptions::least_ml on.
std::optional<Doubt> doubt_of_image(const TissueGone& gone, const std::string& name);
std::optional<Doubt> doubt_of_labels(const TissueGone& gone);

}  // namespace tissuewarp::registration::detail
