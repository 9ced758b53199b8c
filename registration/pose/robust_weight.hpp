#pragma once
/// Weights that let go of outliers.

namespace tissuewarp::registration::detail {

/// (σ²/(σ² + d²))²: the Geman–McClure function's weight in iteratively reweighted least squares.
inline double robust_weight(double distance_mm, double scale_mm) {
    const double squared = scale_mm * scale_mm, share = squared / (squared + distance_mm * distance_mm);
    return share * share;
}

}  // namespace tissuewarp::registration::detail
