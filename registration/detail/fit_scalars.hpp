#pragma once
/// Parameters of a fit as scalars of a standard normal prior.

#include "registration/parameter_fit.hpp"

namespace tissuewarp::registration::detail {

/// Materials and loads to try.
struct Tissue {
    tled::MaterialTable materials;
    TissueLoads loads;
};

/// One degree of freedom: x prior deviations from its given value.
struct FitScalar {
    std::size_t parameter = 0;  ///< of FitOptions
    std::string name, unit;
    TissueParameter kind = TissueParameter::PoissonsRatio;
    int label = 0, axis = 0;
    double given = 0;             ///< in `unit`
    double deviation = 1;         ///< of the prior: of the logarithm for a stiffness ratio, otherwise in `unit`
    double least = -4, most = 4;  ///< of x
    double to_load = 1;           ///< from `unit` to mN/mm³ or kPa, for loads

    /// In `unit`.
    [[nodiscard]] double value(double x) const;
    /// Derivative of `value`.
    [[nodiscard]] double slope(double x) const;
    /// Sets the value in `tissue`, which holds the given one.
    void apply(double x, Tissue& tissue) const;
};

/// Throws InvalidInput for labels that the model has not, laws without Young's modulus, or values outside the bounds.
std::vector<FitScalar> fit_scalars(const PreparedModel& prepared, const TissueLoads& loads, const FitOptions& options);

}  // namespace tissuewarp::registration::detail
