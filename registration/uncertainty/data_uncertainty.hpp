#pragma once
/// What data and tissue leave open: part of the error estimate.

#include "registration/loads/loaded_posterior.hpp"
#include "registration/uncertainty.hpp"
#include "registration/uncertainty/linear_registration.hpp"

#include <Eigen/Core>

#include <optional>

namespace tissuewarp::registration::detail {

/// At the nodes.
struct DataUncertainty {
    Eigen::Matrix<double, 6, Eigen::Dynamic> covariance;  ///< 6 × N mm², in the order of tled/model/symmetric.hpp
    std::optional<HeldOut> held_out;
};

/// The estimate, and the stiffness with the springs that it factorised.
struct OpenParts {
    DataUncertainty data;
    tled::RestStiffness stiffness;
};

/// Of unknown loads on and in the organ, as large as tells the strain energy (mN mm) that the registration found, or,
/// where points of a part alone show it, of smooth bends (unknown_bends.hpp), and of errors of the data; `displacement`
/// (3 × N, mm) is what was found in the frame of the pulls. Throws InvalidInput where the springs do not hold the
/// tissue, SolverFailure without memory for the factors.
OpenParts open_parts(const PreparedModel& prepared, const LastPulls& pulls, const Eigen::Matrix3Xd& displacement,
                     double strain_energy, const UncertaintyOptions& options);

}  // namespace tissuewarp::registration::detail
