#include "apps/output_names.hpp"

#include "apps/bids.hpp"
#include "apps/file_kind.hpp"
#include "imaging/dicom_origin.hpp"

#include <algorithm>

namespace tissuewarp::apps {

namespace {

bool contains(const std::vector<std::string>& words, const std::string& word) {
    return std::find(words.begin(), words.end(), word) != words.end();
}

/// Names of BIDS, and their sidecars, in place of the usual ones.
std::vector<std::string> in_bids(const RegisterOptions& options, const std::vector<std::string>& usual) {
    std::vector<std::string> names;
    for (const std::string& name : usual) {
        names.push_back(bids_name(options, name));
        if (names.back() != name) names.push_back(sidecar_name(names.back()));
    }
    return names;
}

}  // namespace

std::vector<std::string> words_of_write() {
    std::vector<std::string> words;
    for (const OptionalOutput& output : optional_outputs)
        if (!contains(words, output.word)) words.emplace_back(output.word);
    words.emplace_back("all");
    return words;
}

bool writes(const RegisterOptions& options, const OptionalOutput& output) {
    if (!contains(options.write, "all") && !contains(options.write, output.word)) return false;
    const std::string file = output.file;
    if (file.starts_with("warped_landmarks")) return options.landmarks.given();
    if (file.starts_with("warped_points")) return !options.points.empty();
    if (file == "registration.dcm") return imaging::is_dicom(options.fixed) && imaging::is_dicom(options.moving);
    if (file == "structures.dcm") return imaging::is_dicom(options.fixed);
    if (file == "uncertainty.dcm") return imaging::is_dicom(options.fixed) && !options.no_error_estimate;
    if (file == "jacobian.dcm") return imaging::is_dicom(options.moving);
    return true;
}

bool writes_gap(const RegisterOptions& options) {
    return !options.resected.empty() || options.find_resected || (!options.moving.empty() && !options.fixed.empty());
}

bool writes_cavity(const RegisterOptions& options) {
    return options.find_resected && options.match_image && options.fixed_labels.empty();
}

std::vector<std::string> output_names(const RegisterOptions& options) {
    std::vector<std::string> names;
    if (!options.moving.empty()) names.emplace_back("warped.nii.gz");
    for (const char* name :
         {"warped_labels.nii.gz", moving_to_fixed_name, fixed_to_moving_name, transform_name, "mesh.vtu", "record.h5"})
        names.emplace_back(name);
    if (writes_gap(options)) names.emplace_back(gap_name);
    if (writes_cavity(options)) names.emplace_back(cavity_name);
    if (!options.no_error_estimate)
        for (const char* name : {"uncertainty.nii.gz", "uncertainty_trust.nii.gz"}) names.emplace_back(name);
    if (options.landmarks.given()) names.emplace_back("warped_landmarks.csv");
    if (!options.points.empty()) names.emplace_back("warped_points.csv");
    if (!options.surface.empty()) names.push_back(surface_name(options));
    for (const OptionalOutput& output : optional_outputs)
        if (writes(options, output)) names.emplace_back(output.file);
    for (const char* name : {"report.json", "preview.png", "report.html"}) names.emplace_back(name);
    return in_bids(options, names);
}

std::string surface_name(const RegisterOptions& options) {
    return "warped_surface" + options.surface.extension().string();
}

bool is_register_output(const std::string& name) {
    RegisterOptions all;
    all.moving = all.landmarks.csv = all.points = all.surface = "given";
    all.resected = {1};
    all.find_resected = all.match_image = true;
    const std::filesystem::path path(name);
    for (const OptionalOutput& output : optional_outputs)
        if (name == output.file) return true;
    return contains(output_names(all), name) || is_bids_output(name) ||
           (path.stem() == "warped_surface" && file_kind(path) == FileKind::Surface);
}

}  // namespace tissuewarp::apps
