#pragma once
/// What one setting took and gave on one problem.

#include "study/setting.hpp"

#include <Eigen/Core>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::study {

enum class Phase {
    Preparation,  ///< before the operation: mesh, rest state, factor, engine; measured once
    Operation     ///< from what is seen to where the tissue is; measured in every run
};

/// Seconds of a named stage in each run.
struct Stage {
    std::string name;
    Phase phase = Phase::Operation;
    std::vector<double> seconds;
};

/// Errors against a displacement at fixed places, mm.
struct Distance {
    double rms = 0, largest = 0;
};

/// Target registration error, mm.
struct TargetErrors {
    double mean = 0, median = 0, percentile_95 = 0, largest = 0;
    double before = 0;  ///< mean without any registration
};

/// Lengths in mm. What a problem does not have is absent; after a failure, everything but the problem and the setting.
struct Point {
    std::string problem;
    Setting setting;
    int elements = 0, nodes = 0;
    std::string engine, method;  ///< what computed, and which solver the automatic choice took
    std::vector<Stage> stages;
    std::vector<double> seconds;  ///< of the operation in each run, end to end
    int force_evaluations = 0;
    double min_jacobian = 1;
    double estimated_mm = 0;             ///< algebraic error, as the solver estimated it
    std::optional<double> algebraic_mm;  ///< largest nodal distance to the exact answer of the same mesh
    std::optional<Distance> numerical;   ///< to the reference of the same physics
    std::optional<double> reference_mm;  ///< uncertainty of that reference, root mean square
    std::optional<Distance> model;       ///< from that reference to the one of the problem's own physics; 0 for this
    std::optional<TargetErrors> target;  ///< against truth
    Eigen::Matrix3Xd places;             ///< where samples or targets go, mm
    std::string failure;                 ///< in words; empty when there was none
    [[nodiscard]] bool solved() const { return failure.empty(); }

    /// Median and 95th percentile of the runs, and the sum of preparations, s.
    [[nodiscard]] double median_seconds() const;
    [[nodiscard]] double percentile_95_seconds() const;
    [[nodiscard]] double preparation_seconds() const;
    /// What the page puts on its axis, mm: the mean target error where there is truth; otherwise numerical and model
    /// error, root mean square, as if independent: no wrong law gains by a coarse mesh that errs the other way.
    [[nodiscard]] double error_mm() const;
};

/// What `work` makes of the point of a problem in a setting; where its solver fails, the failure and nothing else.
Point attempted(const std::string& problem, const Setting& setting, const std::function<void(Point&)>& work);

/// Of at least one value; between neighbours linear.
double percentile(std::vector<double> values, double share);

/// Root mean square and largest length of the columns.
Distance length_of(const Eigen::Matrix3Xd& differences);

}  // namespace tissuewarp::study
