#pragma once
/// What `evaluate` found, as a table to read and as JSON.

#include "imaging/label_names.hpp"
#include "registration/evaluation/curve_residual.hpp"
#include "registration/evaluation/inverse_consistency.hpp"
#include "registration/evaluation/surface_residual.hpp"
#include "registration/evaluation/target_bins.hpp"

#include <nlohmann/json.hpp>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// Errors of landmarks in bins of one coordinate; `after` where a field mapped them.
struct BinnedErrors {
    std::string coordinate, key;  ///< "depth", "by_depth"
    std::vector<registration::ErrorBin> before;
    std::optional<std::vector<registration::ErrorBin>> after;
};

/// Of curves as the headers place them; `after` where a field carried the lines.
struct CurveErrors {
    registration::CurveResidual before;
    std::optional<registration::CurveResidual> after;
};

/// Scores in the order in which they are added. Lengths in mm; a count of 0 is followed by – in the table, null in
/// JSON.
class ScoreSheet {
public:
    void add(const std::map<int, registration::Overlap>& overlaps, const imaging::LabelNames& names);
    /// `mapped`: a field carried the landmarks, so that there is an error after.
    void add(const registration::TargetError& error, bool mapped);
    void add(const BinnedErrors& errors);
    void add(const registration::JacobianReport& jacobian);
    void add(const registration::InverseConsistency& consistency);
    void add(const registration::SurfaceResidual& residual);
    void add(const CurveErrors& errors);
    void add_notes(const std::vector<std::string>& notes);

    [[nodiscard]] const nlohmann::json& json() const { return json_; }
    [[nodiscard]] const std::string& text() const { return text_; }

private:
    nlohmann::json json_{{"schema", "tissuewarp.evaluation"}, {"schema_version", 1}};
    std::string text_;

    void heading(const std::string& name);
    void row(const std::string& name, const registration::Summary& summary);
};

}  // namespace tissuewarp::apps
