#pragma once
/// The page that shows a study to people: one file that needs no network.

#include "study/findings.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::study {

/// accuracy-time.html, and for each problem its figures as SVG files, in an existing folder; each to a temporary name
/// that is renamed. Problems without a solved point are named without figures. Throws IoError.
void write_page(const std::vector<ProblemSummary>& problems, const std::vector<Point>& points,
                const Provenance& provenance, const std::filesystem::path& folder);

}  // namespace tissuewarp::study
