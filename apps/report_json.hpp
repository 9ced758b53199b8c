#pragma once
/// report.json: everything about a run that a machine may want to read. The keys are listed in
/// docs/manual/register-outputs.md.

#include "apps/register_run.hpp"

#include <nlohmann/json.hpp>

namespace tissuewarp::apps {

/// Lengths in mm, times in s, stiffness in kPa. NaN and infinity become null.
nlohmann::json report_json(const RegistrationRun& run, double total_seconds);

/// Its entry "alignment" alone, which nothing later changes.
nlohmann::json alignment_json(const RegistrationRun& run);

/// Complete or absent. Bytes that are not UTF-8, as file names may hold, are replaced. Throws IoError.
void write_json(const nlohmann::json& document, const std::filesystem::path& path);

/// null in place of what is not finite.
nlohmann::json number_json(double value);
/// null in place of what a summary of nothing would say.
nlohmann::json to_json(const registration::Summary& summary);
nlohmann::json to_json(const registration::TargetError& error);
nlohmann::json to_json(const registration::JacobianReport& report);
/// Keys "1", "2", ... and "all" for the union of the labels.
nlohmann::json to_json(const std::map<int, registration::Overlap>& overlaps, const imaging::LabelNames& names);
nlohmann::json to_json(const meshing::Distribution& distribution);
nlohmann::json to_json(const meshing::QualityReport& quality);
nlohmann::json to_json(const meshing::Fidelity& fidelity);

}  // namespace tissuewarp::apps
