#pragma once
/// Fits of the few numbers about the tissue that intraoperative data can tell, and the word on those that they cannot.

#include "registration/update.hpp"

#include <string>
#include <vector>

namespace tissuewarp::registration {

enum class TissueParameter {
    PoissonsRatio,   ///< of one label or of all; Young's modulus stays
    StiffnessRatio,  ///< Young's modulus of a label over the mean of the others by volume; the others stay
    Gravity,         ///< change of gravity since the preoperative image, three components in the moving frame
    Pressure,        ///< on the organ's outer surface
};

/// A parameter to fit about its given value: that of the prepared model's materials or of UpdateOptions::loads.
struct FitParameter {
    TissueParameter kind = TissueParameter::PoissonsRatio;
    int label = 0;         ///< of a stiffness ratio, or of a Poisson's ratio (0: all labels)
    double deviation = 0;  ///< of the prior: of ν; of the logarithm of a ratio; g; pressure over Young's modulus
};

/// "poissons-ratio", "poissons-ratio:LABEL", "stiffness-ratio:LABEL", "gravity", "pressure", each with the usual
/// deviation of its prior: 0.1; a factor of 3; 1 g on each axis; 0.3. Throws InvalidInput for any other name.
FitParameter fit_parameter(const std::string& name);
std::string name_of(const FitParameter& parameter);

struct FitOptions {
    std::vector<FitParameter> parameters;
    double cube_mm = 25;  ///< edge of the cubes of space that are held out; three edges of the mesh where longer
    double scale_mm = 0;  ///< Geman–McClure scale of a block's misfit; 0: three times what the data differ from the
                          ///< registered model, at least 0.15 mm
    double tolerance_mm = 0.002;  ///< of the equilibria; differences between them are what is fitted
};

enum class FitOutcome {
    Fitted,
    Agrees,      ///< the data would show another value, and do not ask for one
    NotSeen,     ///< the data leave it more than half of the prior's deviation
    Confounded,  ///< another parameter does the same to the data
    AtBound,     ///< the best value is at the end of what is admitted
};

/// One scalar. Unless its outcome is Fitted, the given value stays in use.
struct FittedParameter {
    std::string name, unit;
    double given = 0;
    double fitted = 0;     ///< where the held-out data agree best; of use only where the outcome is Fitted
    double deviation = 0;  ///< standard deviation of `fitted`, prior included
    FitOutcome outcome = FitOutcome::NotSeen;
    std::string reason;  ///< one clause, for a person

    [[nodiscard]] bool identified() const { return outcome == FitOutcome::Fitted; }
};

struct ParameterFit {
    std::vector<FittedParameter> parameters;
    tled::MaterialTable materials;  ///< with what was fitted
    TissueLoads loads;
    double misfit_ratio = 1;  ///< of the held-out data: with the fitted values over with the given ones
    int blocks = 0;           ///< of space that hold data
    int equilibria = 0, force_evaluations = 0;
    double seconds = 0;

    [[nodiscard]] bool any_identified() const;
};

/// Fits after `update`, whose `result` it takes: minimises what data of one half of the cubes miss of the tissue that
/// the other half pulls (cross-validation over blocks of space: Roberts et al. 2017), and says of each parameter
/// whether the data tell it. docs/method.md, section 12.
///
/// Throws InvalidInput for a label or a law that cannot be fitted, Cancelled.
ParameterFit fit_parameters(const PreparedModel& prepared, const UpdateResult& result, const UpdateOptions& update,
                            const FitOptions& options, Observer& observer = silent_observer());

struct FittedUpdate {
    UpdateResult result;
    ParameterFit fit;
};

/// update, fit_parameters, and where these identified something update once more with it; `prepared` then holds the
/// fitted materials. A result of fitted tissue is doubted where no load is known. Throws what these do.
FittedUpdate update_and_fit(PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& update,
                            const FitOptions& options, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
