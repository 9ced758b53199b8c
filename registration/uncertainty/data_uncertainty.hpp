#pragma once
/// What data and tissue leave open: part of the error estimate.

#include "registration/loads/posterior.hpp"
#include "registration/uncertainty.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <optional>

namespace tissuewarp::registration::detail {

/// The estimate's constants. Three of them were chosen on the random phantoms 1–60 and 1001–1120 and are reported on
/// 2001–2112 (docs/accuracy-time.md, "Does the interval hold?").
struct ErrorModel {
    /// Of the covariance of independent data: the noise of a datum is far less than its pull admits, since neighbours
    /// share what they say. Chosen there.
    double noise_share = 0.05;
    double least_energy = 0.2;   ///< of the strain energy unit, that unknown loads have at least. Chosen there
    double freedom_of_size = 6;  ///< the size of the loads is known as a variance is from so many numbers. Chosen there
    /// Where the data left more than this share of the bending that unknown loads make they say next to nothing. Chosen
    /// by hand; on which data is not recorded.
    double shown_below = 0.9;
};
inline constexpr ErrorModel error_model{};

/// With the springs of the last round, and with those of the prior alone.
struct Posteriors {
    WeighedSprings springs;
    Posterior seen, unseen;
    bool parts_alone = false;  ///< neither labels nor an image show the organ as a whole
};

/// Throws InvalidInput where the springs do not hold the tissue, SolverFailure without memory for the factors.
Posteriors posteriors_of(const PreparedModel& prepared, const LastPulls& pulls);

/// At the nodes.
struct DataUncertainty {
    Eigen::Matrix<double, 6, Eigen::Dynamic> covariance;  ///< 6 × N mm²: xx, yy, zz, xy, xz, yz
    Eigen::VectorXd unexplained;  ///< N: part of the variance of bending under unknown loads that the data leave
    std::optional<ExpectedError> expected;  ///< where points alone show the organ
};

/// Of `samples` unknown loads as large as `displacement` (3 × N, mm) tells, and of the noise of the data. The same seed
/// gives the same.
DataUncertainty data_uncertainty(const PreparedModel& prepared, const Posteriors& posteriors,
                                 const Eigen::Matrix3Xd& displacement, int samples, std::uint64_t seed);

}  // namespace tissuewarp::registration::detail
