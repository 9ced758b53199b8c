#pragma once
/// What rows of coverage say: how often intervals hold, and whether a deviation of 1 mm means errors of 1 mm.

#include "study/coverage.hpp"

#include <array>
#include <string>
#include <vector>

namespace tissuewarp::study {

constexpr std::array<double, 4> nominal_shares{0.5, 0.8, 0.95, 0.99};

/// Targets whose estimated deviation lies in a range.
struct ReliabilityBin {
    int targets = 0;
    double estimated_mm = 0, true_mm = 0;  ///< roots of mean squares
};

/// When a registration has failed: so far off, or so much farther than it says, at the 95th percentile of its targets.
struct CoverageFailure {
    double error_mm = 10;
    double error_of_radius = 2;  ///< over the stated radius of 95 %
};
inline constexpr CoverageFailure coverage_failure{};

/// Of one kind of evidence: of the targets in view, or of those out of it.
struct Coverage {
    Evidence evidence = Evidence::Labels;
    bool in_view = true;
    int phantoms = 0, targets = 0;
    double shown_share = 0, unknown_share = 0;  ///< of the targets, by the class that they are given
    double held_95_shown = 0;                   ///< as `held` at 95 %, of those shown; NaN where none is
    double sharpness = 0;  ///< 95th percentile of the errors over the median radius of 95 %: 1 where radii tell apart
    double doubted_share = 0;  ///< of phantoms, whose registration the program doubted
    double failed_share = 0;   ///< of phantoms: see CoverageFailure
    /// Of the phantoms that failed, and of those that did not, the share that was doubted; NaN where there is none.
    double doubted_failures = 0, doubted_successes = 0;
    std::array<double, nominal_shares.size()> held{};  ///< share of targets within the interval of each probability
    /// Standard error of the share at 95 %, from how it varies among phantoms: targets of one phantom are not
    /// independent.
    double held_95_error = 0;
    double estimated_mm = 0, true_mm = 0;  ///< roots of mean squares
    /// Share of phantoms whose error, root mean square over these targets, is within the mean of their intervals of
    /// 95 %, by which an accuracy is promised.
    double phantoms_within = 0;
    std::vector<double> phantom_shares;  ///< at 95 %, of each phantom, ascending
    std::vector<ReliabilityBin> bins;    ///< a tenth of the targets each, by falling trust
};

/// By kind of evidence, what is out of view of an image apart; kinds without rows are left out.
std::vector<Coverage> coverage_of(const std::vector<CoverageRow>& rows);

/// A table for a terminal.
std::string table_of(const std::vector<Coverage>& coverage);

/// Estimated against true deviations, and shares of intervals that hold, as SVG.
std::string coverage_figure(const std::vector<Coverage>& coverage);

}  // namespace tissuewarp::study
