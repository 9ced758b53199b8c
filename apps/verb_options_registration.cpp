// Options of register, and of prepare and update, which share them.

#include "apps/bids.hpp"
#include "apps/option_values.hpp"
#include "apps/output_names.hpp"
#include "apps/registration_checks.hpp"
#include "apps/verb_options.hpp"
#include "core/errors.hpp"
#include "registration/tissues.hpp"

namespace tissuewarp::apps {

namespace {

/// Where the organ is.
void declare_organ(Verb& verb, PreoperativeOptions& o) {
    verb.paths("--moving", o.moving, o.moving_contrasts,
               "Preoperative grey image; without it no warped image is written. Repeatable with --fixed: further "
               "contrasts, matched pair by pair");
    verb.path("--moving-labels", o.moving_labels,
              "Preoperative label map: what is meshed; without it, what is bright in --moving");
    verb.path("--moving-surface", o.moving_surface,
              "Closed surface of the organ in its place: .stl, .ply, .obj, .vtp, .vtk (mm, LPS); its inside is label "
              "1")
        ->excludes("--moving-labels");
    verb.path("--moving-mesh", o.moving_mesh,
              "Tetrahedra of the organ in their place: .vtu, .msh (Gmsh), .inp (Abaqus) (mm, LPS), taken as they are")
        ->excludes("--moving-labels")
        ->excludes("--moving-surface");
    verb.path("--moving-mask", o.moving_mask,
              "Mask over --moving: 0 where it may not be matched (instruments, lesions, artefacts), nonzero where it "
              "may, as in elastix and ANTs");
    verb.path("--label-names", o.label_names, label_names_text);
}

std::vector<std::string> tissue_names() {
    std::vector<std::string> names;
    for (const auto& tissue : registration::tissues()) names.push_back(tissue.name);
    return names;
}

/// A tissue has moduli of its own, and a table tells of every label.
void require_one_tissue(const PreoperativeOptions& o) {
    const PreoperativeOptions untold;
    const bool moduli = o.default_youngs_modulus != untold.default_youngs_modulus ||
                        o.default_poissons_ratio != untold.default_poissons_ratio;
    if (o.tissue != untold.tissue && moduli)
        throw InvalidInput(
            "--tissue " + o.tissue +
            " has moduli of its own; leave out --default-youngs-modulus and --default-poissons-ratio, or "
            "give them in a table (--materials)");
    if (!o.label_tissue.empty() && !o.materials.empty())
        throw InvalidInput("--materials tells of every label; leave out --label-tissue");
}

/// How the model is made of it.
void declare_model(Verb& verb, PreoperativeOptions& o, RegistrationTexts& texts) {
    verb.number("--edge-length", o.edge_length, "MM", 0.0, 100.0,
                "Target edge of the tetrahedra (mm); 0: about 50 000 of them with fixed labels, 15 000 without");
    verb.list("--label-edge-length", texts.label_lengths, "LABEL=MM", "Target edge in one label (mm); repeatable")
        ->delimiter(',');
    verb.path("--materials", o.materials,
              "Material table (TOML): [label.1] youngs_modulus_kpa, poissons_ratio, law, name");
    verb.choice("--tissue", o.tissue, tissue_names(),
                "What the organ is: law, moduli and how it may change its size, in place of --default-...");
    verb.list("--label-tissue", texts.tissues, "LABEL=TISSUE", "What one label is, likewise; repeatable")
        ->delimiter(',');
    verb.number("--default-youngs-modulus", o.default_youngs_modulus, "KPA", 1e-3, 1e6,
                "Young's modulus without a table (kPa)");
    verb.number("--default-poissons-ratio", o.default_poissons_ratio, "RATIO", 0.0, 0.4999,
                "Poisson's ratio without a table");
    verb.choice("--element", o.element, {"auto", "t4", "averaged-pressure"},
                "auto, t4 or averaged-pressure; auto: the latter above a Poisson's ratio of 0.46");
    verb.list("--anchor", texts.anchors, "LABEL", "Labels of tissue that stays where the rigid placement has it")
        ->delimiter(',');
    verb.list("--rigid-neighbour", texts.rigid_neighbours, "LABEL",
              "Labels of bone and the like: not meshed, and the organ slides along them without entering")
        ->delimiter(',');
    verb.list("--sliding", texts.sliding, "LABEL,LABEL",
              "Two labels whose tissue slides on one another where they touch; repeatable")
        ->delimiter(',');
    verb.list(
            "--resected", texts.resected, "LABEL",
            "Labels of tissue that is gone by the time of the operation: a hole is left there; auto (register): sought "
            "in what was seen")
        ->delimiter(',');
    verb.number("--data-stiffness", o.data_stiffness, "KPA/MM", 1e-6, 1e6,
                "Pull of the matched boundary per area (kPa/mm)");
}

void declare_paired_data(Verb& verb, IntraoperativeOptions& o) {
    CLI::Option* fixed_points =
        verb.path("--fixed-points", o.point_pairs.fixed,
                  "Points to register to: CSV pre_x,pre_y,pre_z,intra_x,intra_y,intra_z (mm, LPS); with "
                  "--moving-points, elastix or 3D Slicer points of the fixed image");
    verb.path("--moving-points", o.point_pairs.moving, "The same points in the moving image, likewise")
        ->needs(fixed_points);
    verb.number("--points-sd", o.point_pairs.deviation, "MM", 1e-3, 100.0,
                "Standard deviation of a pair along each axis (mm)");
    CLI::Option* moving_curves =
        verb.path("--moving-curves", o.curves.moving,
                  "Preoperative centre lines of vessels: lines in .vtk or .vtp, curves of 3D Slicer, or CSV x,y,z,line "
                  "(mm, LPS)");
    CLI::Option* fixed_curves = verb.path("--fixed-curves", o.curves.fixed,
                                          "Intraoperative points along the same vessels to register to, likewise; "
                                          "those of no line need no column 'line'");
    moving_curves->needs(fixed_curves);
    fixed_curves->needs(moving_curves);
    verb.number("--curves-sd", o.curves.deviation, "MM", 1e-3, 100.0,
                "Standard deviation of these points along each axis across the vessel (mm)");
}

/// What is seen during the operation.
void declare_data(Verb& verb, IntraoperativeOptions& o) {
    verb.paths("--fixed", o.fixed, o.fixed_contrasts,
               "Intraoperative grey image: gives the output grid; alone, it is what is matched. Repeatable");
    verb.path("--fixed-mask", o.fixed_mask, "0 where --fixed may not be matched, as --moving-mask");
    verb.path("--fixed-labels", o.fixed_labels, "Intraoperative label map: what is matched");
    verb.path("--fixed-surface", o.fixed_surface,
              "Intraoperative points of a part of the surface: .ply, .stl, .obj, .vtk, .vtp, .csv, .xyz (mm, LPS)");
    verb.number("--surface-sd", o.surface_deviation, "MM", 1e-3, 100.0,
                "Standard deviation of these points along the normal (mm)");
    declare_paired_data(verb, o);
    verb.path("--initial-transform", o.initial_transform,
              "Where the alignment begins: a transform of ITK (.tfm, .txt, .h5, .mat), four rows of four numbers, or a "
              "displacement field; each from fixed to moving points, as ITK's (mm, LPS)");
}

/// How the model is registered to it.
void declare_method(Verb& verb, IntraoperativeOptions& o) {
    verb.number("--rounds", o.rounds, "COUNT", 1, 1000, "Rounds of matching and equilibrium");
    verb.number("--tolerance", o.tolerance, "MM", 1e-6, 10.0, "Accepted error of each equilibrium (mm)");
    verb.number("--fade", o.fade, "MM", 1.0, 1e4, "Distance from the organ where the field has become rigid (mm)");
    verb.flag("--match-image", o.match_image, "Match blocks of the images besides the other data");
    verb.choice("--similarity", o.similarity, {"auto", "self-similarity", "linear-combination"},
                "How images are compared; auto: linear-combination where --fixed is ultrasound");
    verb.flag("--no-align", o.no_align,
              "Skip the rigid alignment: the images share one frame, or --initial-transform tells the placement");
    verb.flag("--no-error-estimate", o.no_error_estimate, "Leave out how far off targets may lie, for speed");
    verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>")
        ->check(CLI::Validator(check_device, "", "device"));
}

/// What is carried along and written.
void declare_results(Verb& verb, RegisterOptions& o) {
    verb.path("-o,--output", o.output, "Folder for the results")->required()->type_name("FOLDER");
    verb.landmarks(o.landmarks);
    verb.path("--points", o.points, "Moving points to carry along: CSV x,y,z (mm, LPS)");
    verb.path("--surface", o.surface, "Moving surface to carry along: .ply, .stl, .obj, .vtk, .vtp (mm, LPS)");
    verb.flag("--strict", o.strict, "End with exit code 4 where the result is doubted; everything is written");
    verb.flag("--resample-labels", o.resample_labels, "Accept labels on another grid than their image");
    verb.common(o.common);
    verb.list("--write", o.write, "NAME",
              "Files beside the usual ones: displacement_magnitude (mm), jacobian, organ (its surface with errors), "
              "markups (carried points for 3D Slicer), inverse_transform, dicom (registration, contours and maps for "
              "--fixed in DICOM), or all")
        ->delimiter(',')
        ->check(CLI::IsMember(words_of_write()).description(""));
    verb.text("--bids", o.bids,
              "Subject (01): --output is a derivative dataset of BIDS, and results get its folders, names and "
              "sidecars");
    verb.path("--save-parameters", o.save_parameters, "Write the parameters in use to a TOML file");
    verb.flag("--dry-run", o.dry_run, "Read and check the inputs, say what would be done, write nothing");
}

void declare_config(Verb& verb) {
    verb.app().add_option("--config", "Read parameters from a TOML file; the command line wins")->type_name("FILE");
}

void enter_bids_folder(RegisterOptions& o) {
    if (o.bids.empty()) return;
    o.output = o.output / bids_subject(o.bids) / "anat";
    if (!o.moving.empty()) bids_suffix(o.moving);
}

bool is_auto(const std::vector<std::string>& labels) {
    return labels == std::vector<std::string>{"auto"};
}

void take_texts(PreoperativeOptions& o, const RegistrationTexts& texts) {
    o.label_edge_length = label_lengths(texts.label_lengths);
    o.label_tissue = label_tissues(texts.tissues);
    require_one_tissue(o);
    o.anchors = label_list("--anchor", texts.anchors);
    o.rigid_neighbours = label_list("--rigid-neighbour", texts.rigid_neighbours);
    o.sliding = label_pairs("--sliding", texts.sliding);
    if (!is_auto(texts.resected)) o.resected = label_list("--resected", texts.resected);
}

}  // namespace

void declare_register(Verb& verb, RegisterOptions& o, RegistrationTexts& texts) {
    verb.app().footer(
        "Example:\n  tissuewarp register --moving preop.nii.gz --fixed intraop.nii.gz --output out\n"
        "  tissuewarp register --moving preop.nii.gz --moving-labels preop_labels.nii.gz \\\n"
        "    --fixed intraop.nii.gz --fixed-labels intraop_labels.nii.gz --output out");
    declare_organ(verb, o);
    declare_data(verb, o);
    declare_model(verb, o, texts);
    verb.text("--accuracy", texts.accuracy,
              "Choose the mesh for this error of targets (mm, root mean square), for instance 0.5mm");
    verb.text("--time-budget", texts.time_budget,
              "Choose mesh and rounds for this time, preparation and writing apart, for instance 2s");
    declare_method(verb, o);
    declare_results(verb, o);
    verb.module(o.common);
    declare_config(verb);
}

void declare_prepare(Verb& verb, PrepareModelOptions& o, RegistrationTexts& texts) {
    verb.app().footer(
        "Example:\n  tissuewarp prepare --moving preop.nii.gz --moving-labels preop_labels.nii.gz -o patient.tw");
    declare_organ(verb, o.preoperative);
    declare_model(verb, o.preoperative, texts);
    verb.flag("--for-labels", o.for_labels,
              "Cut the mesh as finely as label maps of the operation make use of, where no edge length is given");
    verb.flag("--resample-labels", o.resample_labels, "Accept labels on another grid than their image");
    verb.path("-o,--output", o.output, "Patient file to write (.tw)")->required();
    verb.common(o.common);
    declare_config(verb);
}

void declare_update(Verb& verb, UpdatePatientOptions& o) {
    verb.app().footer("Example:\n  tissuewarp update patient.tw --fixed-surface patch.ply --output out");
    verb.path("patient", o.patient, "Patient file of prepare (.tw)")->required();
    declare_data(verb, o.registration);
    declare_method(verb, o.registration);
    declare_results(verb, o.registration);
    declare_config(verb);
}

void declare_serve(Verb& verb, ServeOptions& o) {
    verb.app().footer("Example:\n  tissuewarp serve patient.tw --log today.log");
    verb.path("patient", o.patient, "Patient file of prepare (.tw)")->required();
    verb.number("--port", o.port, "NUMBER", 0, 65535, "Port to listen on, of TCP; 0: any that is free");
    verb.text("--bind", o.address,
              "Address to listen on; what is not 127.0.0.1 lets others in, unknown and unencrypted");
    verb.path("--log", o.log, "Log of the session: replays it, and a server that was killed goes on from it");
    CLI::Option* replay =
        verb.path("--replay", o.replay, "Compute the updates of this log again, and compare the bits");
    verb.path("--folder", o.folder, "Folder that requests may read and write; without it they touch no file")
        ->type_name("FOLDER")
        ->excludes(replay);
    verb.path("--targets", o.targets, "Preoperative points to carry along: CSV x,y,z (mm, LPS)");
    verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>")
        ->check(CLI::Validator(check_device, "", "device"));
    verb.common(o.common);
}

void complete_register(RegisterOptions& o, const RegistrationTexts& texts) {
    take_texts(o, texts);
    o.find_resected = is_auto(texts.resected);
    o.accuracy = quantity("--accuracy", texts.accuracy, {{"mm", 1.0}});
    o.time_budget = quantity("--time-budget", texts.time_budget, {{"s", 1.0}, {"ms", 1e-3}});
    require_data(o);
    if (o.match_image && o.moving.empty())
        throw InvalidInput("matching the fixed image takes the moving one; give --moving");
    require_organ(o);
    require_where_to_find_resection(o);
    if (!o.fixed_labels.empty()) refuse_without_labels(o, "--fixed-labels");
    if (!o.moving_mesh.empty() && (o.accuracy || o.time_budget))
        throw InvalidInput("--moving-mesh is taken as it is; leave out --accuracy and --time-budget");
    require_pairs(o);
    require_what_is_written(o);
    enter_bids_folder(o);
    if (!o.match_image && !(o.moving_mask.empty() && o.fixed_mask.empty()))
        throw InvalidInput(
            "--moving-mask and --fixed-mask say what of the images is matched, and they are not; add "
            "--match-image");
}

void complete_prepare(PrepareModelOptions& o, const RegistrationTexts& texts) {
    if (is_auto(texts.resected))
        throw InvalidInput(
            "--resected auto seeks what is gone in what is seen during the operation; give it to register");
    take_texts(o.preoperative, texts);
    require_organ(o.preoperative);
    if (!o.preoperative.moving_mesh.empty() && o.for_labels)
        throw InvalidInput("--moving-mesh is taken as it is; leave out --for-labels");
    if (!o.preoperative.moving_mask.empty() && o.preoperative.moving.empty())
        throw InvalidInput("--moving-mask says what of --moving is matched; give --moving");
}

void complete_update(RegisterOptions& o) {
    require_data(o);
    require_what_is_written(o);
}

void complete_with_patient(RegisterOptions& o, const std::filesystem::path& patient) {
    const std::string name = "'" + patient.string() + "'";
    if (o.match_image && o.moving.empty())
        throw InvalidInput(name + " was prepared without an image, and one is to be matched; prepare with --moving");
    if (!o.fixed_labels.empty()) refuse_without_labels(o, "--fixed-labels");
    if (o.fixed_contrasts.size() > o.moving_contrasts.size())
        throw InvalidInput(
            fmt::format("--fixed is given {} times, and {} was prepared with {} --moving; leave some out",
                        1 + o.fixed_contrasts.size(), name, 1 + o.moving_contrasts.size()));
    require_contrasts_matched(o);
    enter_bids_folder(o);
    if (!o.match_image && !o.fixed_mask.empty())
        throw InvalidInput("--fixed-mask says what of --fixed is matched, and it is not; add --match-image");
}

}  // namespace tissuewarp::apps
