#include "apps/bids.hpp"

#include "apps/output_names.hpp"
#include "apps/versions.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cctype>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// What follows "sub-01_" of a result; {} stands for the suffix of the moving image.
struct BidsName {
    const char* usual;
    const char* name;
    const char* space;  ///< in which its voxels, or the points that it maps, lie
};
constexpr std::array<BidsName, 6> names{{
    {"warped.nii.gz", "space-intraop_desc-warped_{}.nii.gz", "intraop"},
    {"warped_labels.nii.gz", "space-intraop_dseg.nii.gz", "intraop"},
    {transform_name, "from-preop_to-intraop_mode-image_xfm.h5", "intraop"},
    {inverse_transform.file, "from-intraop_to-preop_mode-image_xfm.h5", "preop"},
    {fixed_to_moving_name, "from-preop_to-intraop_mode-image_desc-field_xfm.nii.gz", "intraop"},
    {moving_to_fixed_name, "from-preop_to-intraop_mode-points_desc-field_xfm.nii.gz", "preop"},
}};

const BidsName* entry_of(const std::string& usual) {
    const auto* entry = std::find_if(names.begin(), names.end(), [&](const BidsName& n) { return usual == n.usual; });
    return entry == names.end() ? nullptr : entry;
}

bool is_alphanumeric(const std::string& text) {
    return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c); });
}

json generated_by() {
    return json::array({{{"Name", "tissuewarp"}, {"Version", program_version()}}});
}

}  // namespace

std::string bids_subject(const std::string& given) {
    const std::string label = given.starts_with("sub-") ? given.substr(4) : given;
    if (!is_alphanumeric(label))
        throw InvalidInput(fmt::format("--bids '{}' is no subject; give letters and digits, for instance 01", given));
    return "sub-" + label;
}

std::string bids_suffix(const fs::path& image) {
    const std::string name = image.filename().string(), stem = name.substr(0, name.find('.'));
    const std::size_t at = stem.rfind('_');
    if (!stem.starts_with("sub-") || at == std::string::npos || !is_alphanumeric(stem.substr(at + 1)))
        throw InvalidInput(fmt::format(
            "--bids takes the kind of image from the name of --moving, and '{}' tells none; name it as BIDS "
            "does, for instance sub-01_ses-preop_T1w.nii.gz",
            name));
    return stem.substr(at + 1);
}

std::string bids_name(const RegisterOptions& options, const std::string& usual) {
    const BidsName* entry = entry_of(usual);
    if (options.bids.empty() || !entry) return usual;
    std::string name = bids_subject(options.bids) + "_" + entry->name;
    if (const auto at = name.find("{}"); at != std::string::npos) name.replace(at, 2, bids_suffix(options.moving));
    return name;
}

std::string sidecar_name(const std::string& bids_name) {
    return bids_name.substr(0, bids_name.find('.')) + ".json";
}

std::string sidecar(const RegisterOptions& options, const std::string& usual) {
    json sources = json::array();
    for (const fs::path& path : {options.moving, options.moving_labels, options.fixed, options.fixed_labels})
        if (!path.empty()) sources.push_back(path.string());
    const json content = {{"Sources", sources}, {"Space", entry_of(usual)->space}, {"GeneratedBy", generated_by()}};
    return content.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

void write_bids_dataset(const RegisterOptions& options) {
    const fs::path root = options.output.parent_path().parent_path();  // of root/sub-01/anat
    if (!fs::exists(root / "dataset_description.json")) {
        const json description = {{"Name", "tissuewarp"},
                                  {"BIDSVersion", "1.8.0"},
                                  {"DatasetType", "derivative"},
                                  {"GeneratedBy", generated_by()}};
        write_file(description.dump(2) + "\n", root / "dataset_description.json");
    }
    std::string ignored;
    RegisterOptions all = options;
    all.write = {"all"};
    if (all.resected.empty()) all.resected = {1};
    for (const std::string& name : output_names(all))
        if (!is_bids_output(name)) ignored += name + "\n";
    if (!fs::exists(root / ".bidsignore")) write_file(ignored, root / ".bidsignore");
}

bool is_bids_output(const std::string& name) {
    if (!name.starts_with("sub-")) return false;
    return std::any_of(names.begin(), names.end(), [&](const BidsName& entry) {
        const std::string pattern = entry.name, stem = pattern.substr(0, pattern.find_first_of(".{"));
        const bool ends = name.ends_with(pattern.substr(pattern.find('.'))) || name.ends_with(".json");
        return ends && name.find("_" + stem) != std::string::npos;
    });
}

}  // namespace tissuewarp::apps
