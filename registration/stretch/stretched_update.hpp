#pragma once
/// Registrations of tissue that changes its size and shape freely, as lungs do when they breathe.

#include "registration/tissues.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"

#include <Eigen/Geometry>

#include <memory>

namespace tissuewarp::registration {

struct StretchedUpdate {
    UpdateResult result;  ///< of the model as it was given: its displacements hold the stretch
    /// That the organ took up as a whole without strain: symmetric linear part, moving frame.
    Eigen::Affine3d stretch = Eigen::Affine3d::Identity();
    std::shared_ptr<const PreparedModel> strain_free;  ///< the model in that shape, in which it was solved
};

/// Whether a registration is to begin from a stretch: of tissue that has a free one, and from labels alone, without
/// anchors and rigid neighbours, since all else is told about the shape in the moving image.
bool stretches_freely(const PreparedModel& prepared, const Intraoperative& seen, const Tissue& tissue);

/// Places and stretches the organ as a whole by its labels (pose/free_stretch.hpp), makes the model anew in that shape,
/// free of strain, and registers it from there. Precondition: stretches_freely. Throws as update().
StretchedUpdate update_stretched(const PreparedModel& prepared, const Intraoperative& seen, const Tissue& tissue,
                                 const UpdateOptions& options = {}, Observer& observer = silent_observer());

/// What labels leave open of a stretch. Chosen on synthetic breaths 1 to 5, reported on 105 to 110 and on patients
/// (docs/decisions/large_motion.md).
struct StretchErrors {
    double share = 0.35;  ///< of how far tissue was displaced: 1 σ, root of the expected square of the error's length
};
inline constexpr StretchErrors stretch_errors{};

/// How far off its result may be: of the registration from the stretch, and of the stretch.
Uncertainty uncertainty(const StretchedUpdate& update, const UncertaintyOptions& options = {},
                        Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
