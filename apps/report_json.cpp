#include "apps/report_json.hpp"

#include "apps/output_names.hpp"
#include "apps/register_outputs.hpp"
#include "apps/report_tissue.hpp"
#include "apps/versions.hpp"
#include "core/atomic_file.hpp"
#include "imaging/labels.hpp"

#include <cmath>

namespace tissuewarp::apps {

using nlohmann::json;

json number_json(double value) {
    return std::isfinite(value) ? json(value) : json(nullptr);
}

namespace {

json vector(const Eigen::Vector3d& v) {
    return {v.x(), v.y(), v.z()};
}

json geometry(const imaging::Geometry& grid) {
    json direction = json::array();
    for (int row = 0; row < 3; ++row) direction.push_back(vector(grid.direction.row(row).transpose()));
    return {{"size", grid.size},
            {"spacing", vector(grid.spacing)},
            {"origin", vector(grid.origin)},
            {"direction", direction}};
}

json inputs(const RegistrationInputs& inputs) {
    const std::map<std::string, const imaging::Volume*> volumes{{"moving", &inputs.moving},
                                                                {"moving-labels", &inputs.moving_labels},
                                                                {"fixed", &inputs.fixed},
                                                                {"fixed-labels", &inputs.fixed_labels}};
    json object = json::object();
    for (const InputFile& file : inputs.files) {
        json& entry = object[file.role];
        entry["path"] = file.path.string();
        entry["sha256"] = file.sha256.empty() ? json(nullptr) : json(file.sha256);
        const auto volume = volumes.find(file.role);
        if (volume != volumes.end()) entry["geometry"] = geometry(volume->second->geometry);
    }
    return object;
}

json foreground(const imaging::Foreground& found) {
    return {{"threshold", number_json(found.threshold)},
            {"volume_ml", number_json(found.volume_mm3 / 1000)},
            {"image_share", number_json(found.image_share)}};
}

json start(const registration::StartPose& pose) {
    json matrix = json::array();
    for (int row = 0; row < 4; ++row) {
        const Eigen::RowVector4d values = pose.placement.matrix().row(row);
        matrix.push_back({values[0], values[1], values[2], values[3]});
    }
    return {{"matrix", matrix},
            {"deformation_mm", number_json(pose.deformation_mm)},
            {"furthest_mm", number_json(pose.furthest_mm)}};
}

json parameters(const RegisterOptions& options) {
    json object = json::object();
    for (const Parameter& parameter : options.parameters) {
        const std::string& last = parameter.values.back();
        switch (parameter.kind) {
            case Parameter::Kind::Number:
                object[parameter.name] = std::stod(last);
                break;
            case Parameter::Kind::Switch:
                object[parameter.name] = last == "true";
                break;
            case Parameter::Kind::Text:
                object[parameter.name] = last;
                break;
            case Parameter::Kind::TextList:
                object[parameter.name] = parameter.values;
                break;
        }
    }
    return object;
}

/// What the conversion to Lamé's constants and back left behind the tenth digit goes.
double rounded(double value) {
    return std::round(value * 1e10) / 1e10;
}

/// The moduli in use, those of labels that took the default included.
json materials(const RegistrationRun& run) {
    json object = json::object();
    for (const auto& [label, material] : run.prepared->model.materials) {
        const double mu = tled::shear_modulus(material), nu = tled::poisson_ratio(material);
        const auto entry = run.inputs.materials.find(label);
        object[std::to_string(label)] = {
            {"name", entry == run.inputs.materials.end() ? run.options.tissue : entry->second.name},
            {"law", std::holds_alternative<tled::NeoHookeanIso>(material) ? "neo-hookean-iso" : "neo-hookean-lnj"},
            {"youngs_modulus_kpa", rounded(2 * mu * (1 + nu))},
            {"poissons_ratio", rounded(nu)}};
    }
    return object;
}

json rows_of(const Eigen::Isometry3d& motion) {
    json rows = json::array();
    for (int row = 0; row < 4; ++row) {
        const Eigen::Vector4d r = motion.matrix().row(row).transpose();
        rows.push_back({r[0], r[1], r[2], r[3]});
    }
    return rows;
}

json alignment(const RegistrationRun& run) {
    const Eigen::Isometry3d& placement = run.result.alignment.placement;
    const Eigen::Matrix3d linear =
        run.stretched ? run.stretched->stretch.linear() : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    json stretch = json::array();
    for (int row = 0; row < 3; ++row) stretch.push_back(vector(linear.row(row).transpose()));
    const double angle = Eigen::AngleAxisd(placement.linear()).angle() * 180 / 3.14159265358979323846;
    return {{"performed", !run.options.no_align},
            {"matrix", rows_of(placement)},
            {"rotation_deg", angle},
            {"translation_mm", vector(placement.translation())},
            {"free_stretch", stretch},
            {"mean_distance_mm", number_json(run.result.alignment.mean_distance_mm)}};
}

json rounds(const RegistrationRun& run) {
    json list = json::array();
    for (const registration::Round& round : run.result.rounds)
        list.push_back({{"range_mm", number_json(round.range_mm)},
                        {"matched", round.matched},
                        {"interface_nodes", round.interface_nodes},
                        {"held_back", round.held_back},
                        {"mean_residual_mm", number_json(round.mean_residual_mm)},
                        {"largest_change_mm", number_json(round.largest_change_mm)},
                        {"force_evaluations", round.force_evaluations},
                        {"estimated_error_mm", number_json(round.estimated_error_mm)}});
    return list;
}

json stages(const RegistrationRun& run) {
    json list = json::array();
    for (const auto& [stage, seconds] : run.times) list.push_back({{"stage", stage}, {"seconds", seconds}});
    return list;
}

json notes(const RegistrationRun& run) {
    std::vector<std::string> all = run.inputs.notes;
    all.insert(all.end(), run.notes.begin(), run.notes.end());
    return all;
}

json doubts(const std::vector<registration::Doubt>& doubts) {
    json list = json::array();
    for (const registration::Doubt& doubt : doubts)
        list.push_back({{"code", doubt.code},
                        {"severity", name_of(doubt.severity)},
                        {"value", number_json(doubt.value)},
                        {"limit", number_json(doubt.limit)},
                        {"text", doubt.text},
                        {"remedy", doubt.remedy}});
    return list;
}

json mesh(const RegistrationRun& run) {
    json object = to_json(meshing::quality(run.result.deformation.mesh));
    const bool t4 = run.prepared->model.element == tled::Element::T4;
    object["element"] = t4 ? "t4" : "averaged-pressure";
    object["nodes"] = run.result.deformation.mesh.node_count();
    object["tetrahedra"] = run.result.deformation.mesh.tet_count();
    object["edge_length_mm"] = run.prepared->options.meshing.edge_length;
    return object;
}

json to_json(const registration::ImageFit& fit) {
    return {{"blocks", fit.blocks},
            {"matched", fit.matched},
            {"residual_mm", number_json(fit.residual_mm)},
            {"agreement", fit.agreement ? number_json(*fit.agreement) : json()},
            {"shown_share", number_json(fit.shown_share)}};
}

/// How points agree with the model, and what is expected where they are all there is.
void add_fits(json& report, const registration::UpdateResult& result) {
    if (!result.images.empty()) report["image"] = to_json(result.images.front());
    for (std::size_t n = 1; n < result.images.size(); ++n) report["contrasts"].push_back(to_json(result.images[n]));
    if (const auto& fit = result.surface)
        report["surface"] = {{"inlier_share", number_json(fit->inlier_share)},
                             {"residual_mm", number_json(fit->residual_mm)},
                             {"coverage", number_json(fit->coverage)}};
    if (const auto& fit = result.points)
        report["points"] = {
            {"used", fit->used}, {"outliers", fit->outliers}, {"residual_mm", number_json(fit->residual_mm)}};
    if (const auto& fit = result.curves)
        report["curves"] = {{"points", fit->points},
                            {"inlier_share", number_json(fit->inlier_share)},
                            {"residual_mm", number_json(fit->residual_mm)},
                            {"length_mm", number_json(fit->length_mm)}};
    if (const auto& fit = result.contact)
        report["contact"] = {{"touching", fit->touching}, {"deepest_mm", number_json(fit->deepest_mm)}};
    for (const registration::BodyMotion& body : result.bodies)
        if (body.own)
            report["rigid_neighbours"].push_back(
                {{"label", body.label}, {"matrix", rows_of(body.motion)}, {"apart_mm", number_json(body.apart_mm)}});
    if (const auto& fit = result.anchors)
        report["anchors"] = {{"nodes", fit->nodes}, {"largest_mm", number_json(fit->largest_mm)}};
}

json to_json(const registration::HeldOut& held_out) {
    return {{"z", number_json(held_out.z)}, {"regions", held_out.regions}, {"seconds", held_out.seconds}};
}

json to_json(const registration::UncertaintySummary& s) {
    return {{"algebraic_mm", number_json(s.algebraic_mm)},
            {"discretisation_mm", number_json(s.discretisation_mm)},
            {"data_mm", number_json(s.data_mm)},
            {"deviation_mm", number_json(s.deviation_mm)},
            {"interval_95_mm", number_json(s.interval_mm)},
            {"worst_interval_95_mm", number_json(s.worst_interval_mm)},
            {"worst_place_mm", vector(s.worst_place)},
            {"shown_share", number_json(s.shown_share)},
            {"unknown_share", number_json(s.unknown_share)},
            {"beyond_10_mm_share", number_json(s.failed_share)}};
}

/// What was asked for, chosen and expected.
json dial(const RegistrationRun& run) {
    const registration::DialChoice& choice = *run.dial;
    json object{{"edge_length_mm", choice.edge_length_mm},
                {"expected_seconds", choice.seconds},
                {"expected_error_mm", choice.error_mm},
                {"expected_error_95_mm", choice.error_95_mm},
                {"reason", choice.reason}};
    if (run.options.accuracy) object["accuracy_mm"] = *run.options.accuracy;
    if (run.options.time_budget) object["time_budget_s"] = *run.options.time_budget;
    return object;
}

}  // namespace

void write_json(const json& document, const std::filesystem::path& path) {
    write_file(document.dump(2, ' ', false, json::error_handler_t::replace) + "\n", path);
}

json to_json(const registration::Summary& s) {
    if (s.count == 0)
        return {{"count", 0}, {"mean", nullptr}, {"median", nullptr}, {"percentile_95", nullptr}, {"maximum", nullptr}};
    return {{"count", s.count},
            {"mean", number_json(s.mean)},
            {"median", number_json(s.median)},
            {"percentile_95", number_json(s.percentile_95)},
            {"maximum", number_json(s.maximum)}};
}

json to_json(const registration::TargetError& error) {
    return {{"all", {{"before", to_json(error.before)}, {"after", to_json(error.after)}}},
            {"moved",
             {{"threshold_mm", error.moved_mm},
              {"before", to_json(error.moved_before)},
              {"after", to_json(error.moved_after)}}}};
}

json to_json(const registration::JacobianReport& report) {
    json places = json::array();
    for (const Eigen::Vector3d& place : report.folded_places) places.push_back(vector(place));
    return {{"minimum", number_json(report.minimum)},
            {"percentile_1", number_json(report.percentile_1)},
            {"percentile_5", number_json(report.percentile_5)},
            {"median", number_json(report.median)},
            {"percentile_95", number_json(report.percentile_95)},
            {"percentile_99", number_json(report.percentile_99)},
            {"maximum", number_json(report.maximum)},
            {"folded", report.folded},
            {"folded_share", number_json(report.folded_share)},
            {"folded_mm3", number_json(report.folded_mm3)},
            {"folded_places_mm", places}};
}

json to_json(const registration::Unfolding& unfolding) {
    return {{"voxels", unfolding.voxels},
            {"left", unfolding.left},
            {"in_organ", unfolding.in_organ},
            {"sliding", unfolding.sliding},
            {"most_in_organ_mm", number_json(unfolding.most_in_organ_mm)}};
}

json to_json(const std::map<int, registration::Overlap>& overlaps, const imaging::LabelNames& names) {
    json object = json::object();
    for (const auto& [label, overlap] : overlaps) {
        json& entry = object[label == 0 ? "all" : std::to_string(label)];
        entry = {{"dice", number_json(overlap.dice)},
                 {"hausdorff_95_mm", number_json(overlap.hausdorff_95_mm)},
                 {"mean_surface_distance_mm", number_json(overlap.mean_surface_distance_mm)}};
        if (const auto named = names.find(label); named != names.end()) entry["name"] = named->second;
    }
    return object;
}

json to_json(const meshing::Distribution& d) {
    return {{"minimum", number_json(d.minimum)}, {"percentile_1", number_json(d.percentile_1)},
            {"median", number_json(d.median)},   {"percentile_99", number_json(d.percentile_99)},
            {"maximum", number_json(d.maximum)}, {"mean", number_json(d.mean)}};
}

json to_json(const meshing::QualityReport& quality) {
    json volumes = json::object();
    for (const auto& [label, volume] : quality.label_volume_mm3) volumes[std::to_string(label)] = volume;
    return {{"min_dihedral_deg", to_json(quality.min_dihedral_deg)},
            {"max_dihedral_deg", to_json(quality.max_dihedral_deg)},
            {"radius_edge", to_json(quality.radius_edge)},
            {"volume_mm3", to_json(quality.volume_mm3)},
            {"edge_mm", to_json(quality.edge_mm)},
            {"label_volume_mm3", volumes},
            {"step_limiting_tetrahedron", quality.step_limiting_tet},
            {"step_limit_mm", number_json(quality.step_limit_mm)},
            {"components", quality.components}};
}

json to_json(const meshing::Fidelity& fidelity) {
    json ratios = json::object();
    for (const auto& [label, ratio] : fidelity.volume_ratio) ratios[std::to_string(label)] = ratio;
    return {{"volume_ratio", ratios},
            {"mean_surface_distance_mm", number_json(fidelity.mean_surface_distance_mm)},
            {"hausdorff_95_mm", number_json(fidelity.hausdorff_95_mm)},
            {"hausdorff_mm", number_json(fidelity.hausdorff_mm)}};
}

json alignment_json(const RegistrationRun& run) {
    return {{"alignment", alignment(run)}};
}

json report_json(const RegistrationRun& run, double total_seconds) {
    const Scores& scores = run.scores;
    json report{{"schema", "tissuewarp.report"},
                {"schema_version", 2},
                {"program", "tissuewarp"},
                {"version", program_version()},
                {"versions", versions()},
                {"started", run.started},
                {"inputs", inputs(run.inputs)},
                {"parameters", parameters(run.options)},
                {"materials", materials(run)},
                {"device", run.result.engine},
                {"mesh", mesh(run)},
                {"alignment", alignment(run)},
                {"rounds", rounds(run)},
                {"jacobian",
                 {{"mesh", to_json(scores.mesh)},
                  {"field_in_organ", to_json(scores.organ)},
                  {"field", to_json(scores.grid)},
                  {"unfolded",
                   {{"moving_to_fixed", to_json(run.products.unfolded_forth)},
                    {"fixed_to_moving", to_json(run.products.unfolded_back)}}}}},
                {"doubts", doubts(run.result.doubts)},
                {"notes", notes(run)},
                {"outputs", output_names(run.options)},
                {"stages", stages(run)},
                {"total_seconds", total_seconds},
                {"peak_memory_mb", static_cast<double>(peak_memory_bytes()) / 1e6}};
    report["estimated_error_mm"] =
        run.result.rounds.empty() ? json(nullptr) : number_json(run.result.rounds.back().estimated_error_mm);
    if (!scores.after.empty())
        report["overlap"] = {{"before", to_json(scores.before, run.inputs.label_names)},
                             {"after", to_json(scores.after, run.inputs.label_names)}};
    if (run.inputs.foreground) report["foreground"] = foreground(*run.inputs.foreground);
    if (run.inputs.start) report["initial_transform"] = start(*run.inputs.start);
    if (!run.products.gap.empty()) report["resected"] = resected_json(run);
    if (!run.prepared->sliding.empty()) report["sliding"] = sliding_json(run);
    if (!run.products.parted.empty()) report["parted_ml"] = number_json(imaging::millilitres(run.products.parted));
    add_fits(report, run.result);
    if (run.products.uncertainty) {
        report["error_estimate"] = to_json(registration::summarise(*run.products.uncertainty));
        if (const auto& held_out = run.products.uncertainty->held_out()) report["held_out"] = to_json(*held_out);
    }
    report["intraoperative_seconds"] = run.intraoperative_seconds;
    if (run.dial) report["dial"] = dial(run);
    if (scores.target_error) report["target_registration_error"] = to_json(*scores.target_error);
    if (scores.curves)
        report["curves"]["to_lines"] = {{"before", to_json(scores.curves->before)},
                                        {"after", to_json(scores.curves->after)}};
    return report;
}

}  // namespace tissuewarp::apps
