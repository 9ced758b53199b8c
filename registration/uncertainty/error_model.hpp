#pragma once
/// The constants of the error estimate.

namespace tissuewarp::registration::detail {

/// Those that say so were chosen on the random patients 1 to 9 of all three families, and are reported on others
/// (docs/decisions/error_model.md).
struct ErrorModel {
    /// Of the covariance of independent data: the noise of a datum is far less than its pull admits, since neighbours
    /// share what they say. Chosen on the random phantoms 1–60 and 1001–1120.
    double noise_share = 0.05;
    double shared_over_mm = 10;  ///< length over which the errors that neighbouring data share vary. By hand
    double least_energy = 0.2;   ///< of the strain energy unit, that unknown loads have at least. As the noise
    /// Of what the motion says of the size of the loads, beside what the strain energy says: an exponent. Chosen on
    /// 741 to 776 of the three families of `study coverage`; that it counts where a part alone is seen, on four pairs
    /// of lungs.
    double motion_weight = 0.2;
    double freedom_of_size = 6;  ///< the size of the loads is known as a variance is from so many numbers. As the noise
    double unseen_motion_mm = 20;  ///< of the organ as a whole where no datum shows it; as TissuePrior::free_motion_mm
    double failed_mm = 5;          ///< places known no better (95 %) are not known. A matter of words
};
inline constexpr ErrorModel error_model{};

}  // namespace tissuewarp::registration::detail
