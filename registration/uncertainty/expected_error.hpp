#pragma once
/// How far off tissue is expected to lie where points alone show the organ, from the deviations of the data and the
/// prior alone; nothing of what was found enters but where the data pull.

#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <Eigen/Core>

#include <optional>

namespace tissuewarp::registration {

/// Root mean square over places all over the organ, and the place that is known least.
struct ExpectedError {
    double mean_mm = 0, worst_mm = 0;
    Eigen::Vector3d worst_place = Eigen::Vector3d::Zero();  ///< moving frame, LPS mm
};

/// Makes a factor of the stiffness; uncertainty() gives the same with its own. Throws InvalidInput for a result of
/// labels or an image, which show the organ as a whole.
ExpectedError expected_error(const PreparedModel& prepared, const UpdateResult& result);

/// In words, where the data show too little of the organ to tell a registration from one that failed (tissue 5 mm off),
/// and what would help; otherwise empty.
std::optional<Doubt> doubt_of_data(const ExpectedError& expected);

}  // namespace tissuewarp::registration
