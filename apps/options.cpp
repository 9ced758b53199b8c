// The one translation unit that includes CLI11.

#include "apps/options.hpp"

#include "apps/bids.hpp"
#include "apps/config_file.hpp"
#include "apps/option_values.hpp"
#include "apps/output_names.hpp"
#include "apps/verb.hpp"
#include "apps/versions.hpp"
#include "core/errors.hpp"
#include "imaging/dicom_origin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <tuple>

namespace tissuewarp::apps {

namespace {

constexpr const char* label_names_text =
    "Names of the labels: a colour table of 3D Slicer (.ctbl, .txt, .csv) or a label file of ITK-SNAP";

/// All verbs with the structs that they fill.
struct Parser {
    CLI::App app{
        "Registers images of soft tissue by simulating the tissue. Lengths in mm, stiffness in kPa, points in LPS.",
        "tissuewarp"};
    RegisterOptions registration;
    MeshOptions mesh;
    WarpOptions warp;
    ConvertOptions convert;
    EvaluateOptions evaluate;
    InfoOptions info;
    BenchOptions bench;
    SimulateOptions simulate;
    ExplainOptions explain;
    CalibrateOptions calibrate;
    StudyOptions study;
    std::filesystem::path config;
    std::string accuracy, time_budget;
    std::vector<std::string> register_lengths, mesh_lengths, info_files, anchors, rigid_neighbours;
    std::deque<Verb> verbs;

    Parser() {
        app.require_subcommand(1);
        app.set_version_flag("--version", "tissuewarp " + program_version());
        app.footer(
            "Documents:\n  docs/index.md               In the sources, and in /usr/share/doc/tissuewarp of packages");
        declare_register(verbs.emplace_back(app, "register", "Register a segmented volume to another, or to points"));
        declare_mesh(verbs.emplace_back(app, "mesh", "Turn a label map into tetrahedra"));
        declare_warp(verbs.emplace_back(app, "warp", "Carry an image, labels, points or a surface along"));
        declare_convert(verbs.emplace_back(app, "convert", "Turn a transform or field into another program's"));
        declare_evaluate(verbs.emplace_back(app, "evaluate", "Score label maps, landmarks, curves and fields"));
        declare_info(verbs.emplace_back(app, "info", "Print what a file holds, or the devices of this machine"));
        declare_bench(verbs.emplace_back(app, "bench", "Time the solver's engines on this machine"));
        declare_simulate(verbs.emplace_back(app, "simulate", "Simulate what a scene file names"));
        declare_explain(verbs.emplace_back(app, "explain", "Print what a scene will run and what a step costs"));
        declare_calibrate(
            verbs.emplace_back(app, "calibrate", "Measure on phantoms what --accuracy and --time-budget choose by"));
        declare_study(verbs.emplace_back(app, "study", "Measure what accuracy costs in time on this machine"));
        for (Verb& verb : verbs) verb.arrange(help_layout(verb.name()));
    }

    void declare_register(Verb& verb) {
        RegisterOptions& o = registration;
        verb.app().footer(
            "Example:\n  tissuewarp register --moving preop.nii.gz --fixed intraop.nii.gz --output out\n"
            "  tissuewarp register --moving preop.nii.gz --moving-labels preop_labels.nii.gz \\\n"
            "    --fixed intraop.nii.gz --fixed-labels intraop_labels.nii.gz --output out");
        verb.paths("--moving", o.moving, o.moving_contrasts,
                   "Preoperative grey image; without it no warped image is written. Repeatable with --fixed: further "
                   "contrasts, matched pair by pair");
        verb.path("--moving-labels", o.moving_labels,
                  "Preoperative label map: what is meshed; without it, what is bright in --moving");
        verb.path(
                "--moving-surface", o.moving_surface,
                "Closed surface of the organ in its place: .stl, .ply, .obj, .vtp, .vtk (mm, LPS); its inside is label "
                "1")
            ->excludes("--moving-labels");
        verb.path(
                "--moving-mesh", o.moving_mesh,
                "Tetrahedra of the organ in their place: .vtu, .msh (Gmsh), .inp (Abaqus) (mm, LPS), taken as they are")
            ->excludes("--moving-labels")
            ->excludes("--moving-surface");
        verb.paths("--fixed", o.fixed, o.fixed_contrasts,
                   "Intraoperative grey image: gives the output grid; alone, it is what is matched. Repeatable");
        verb.path(
            "--moving-mask", o.moving_mask,
            "Mask over --moving: 0 where it may not be matched (instruments, lesions, artefacts), nonzero where it "
            "may, as in elastix and ANTs");
        verb.path("--fixed-mask", o.fixed_mask, "The same over --fixed");
        verb.path("--fixed-labels", o.fixed_labels, "Intraoperative label map: what is matched");
        verb.path("--label-names", o.label_names, label_names_text);
        verb.path("--fixed-surface", o.fixed_surface,
                  "Intraoperative points of a part of the surface: .ply, .stl, .obj, .vtk, .vtp, .csv, .xyz (mm, LPS)");
        verb.number("--surface-sd", o.surface_deviation, "MM", 1e-3, 100.0,
                    "Standard deviation of these points along the normal (mm)");
        CLI::Option* fixed_points =
            verb.path("--fixed-points", o.point_pairs.fixed,
                      "Points to register to: CSV pre_x,pre_y,pre_z,intra_x,intra_y,intra_z (mm, LPS); with "
                      "--moving-points, elastix or 3D Slicer points of the fixed image");
        verb.path("--moving-points", o.point_pairs.moving, "The same points in the moving image, likewise")
            ->needs(fixed_points);
        verb.number("--points-sd", o.point_pairs.deviation, "MM", 1e-3, 100.0,
                    "Standard deviation of a pair along each axis (mm)");
        CLI::Option* moving_curves = verb.path(
            "--moving-curves", o.curves.moving,
            "Preoperative centre lines of vessels: lines in .vtk or .vtp, curves of 3D Slicer, or CSV x,y,z,line "
            "(mm, LPS)");
        CLI::Option* fixed_curves = verb.path("--fixed-curves", o.curves.fixed,
                                              "Intraoperative points along the same vessels to register to, likewise; "
                                              "those of no line need no column 'line'");
        moving_curves->needs(fixed_curves);
        fixed_curves->needs(moving_curves);
        verb.number("--curves-sd", o.curves.deviation, "MM", 1e-3, 100.0,
                    "Standard deviation of these points along each axis across the vessel (mm)");
        verb.path("-o,--output", o.output, "Folder for the results")->required()->type_name("FOLDER");
        verb.landmarks(o.landmarks);
        verb.path("--points", o.points, "Moving points to carry along: CSV x,y,z (mm, LPS)");
        verb.path("--surface", o.surface, "Moving surface to carry along: .ply, .stl, .obj, .vtk, .vtp (mm, LPS)");
        verb.text("--accuracy", accuracy,
                  "Choose the mesh for this error of targets (mm, root mean square), for instance 0.5mm");
        verb.text("--time-budget", time_budget,
                  "Choose mesh and rounds for this time, preparation and writing apart, for instance 2s");
        verb.number("--edge-length", o.edge_length, "MM", 0.0, 100.0,
                    "Target edge of the tetrahedra (mm); 0: about 50 000 of them with fixed labels, 15 000 without");
        verb.list("--label-edge-length", register_lengths, "LABEL=MM", "Target edge in one label (mm); repeatable")
            ->delimiter(',');
        verb.path("--materials", o.materials,
                  "Material table (TOML): [label.1] youngs_modulus_kpa, poissons_ratio, law, name");
        verb.number("--default-youngs-modulus", o.default_youngs_modulus, "KPA", 1e-3, 1e6,
                    "Young's modulus without a table (kPa)");
        verb.number("--default-poissons-ratio", o.default_poissons_ratio, "RATIO", 0.0, 0.4999,
                    "Poisson's ratio without a table");
        verb.choice("--element", o.element, {"auto", "t4", "averaged-pressure"},
                    "auto, t4 or averaged-pressure; auto: the latter above a Poisson's ratio of 0.46");
        verb.list("--anchor", anchors, "LABEL", "Labels of tissue that stays where the rigid placement has it")
            ->delimiter(',');
        verb.list("--rigid-neighbour", rigid_neighbours, "LABEL",
                  "Labels of bone and the like: not meshed, and the organ slides along them without entering")
            ->delimiter(',');
        verb.number("--rounds", o.rounds, "COUNT", 1, 1000, "Rounds of matching and equilibrium");
        verb.number("--tolerance", o.tolerance, "MM", 1e-6, 10.0, "Accepted error of each equilibrium (mm)");
        verb.number("--data-stiffness", o.data_stiffness, "KPA/MM", 1e-6, 1e6,
                    "Pull of the matched boundary per area (kPa/mm)");
        verb.number("--fade", o.fade, "MM", 1.0, 1e4, "Distance from the organ where the field has become rigid (mm)");
        verb.flag("--match-image", o.match_image, "Match blocks of the images besides the other data");
        verb.flag("--no-align", o.no_align,
                  "Skip the rigid alignment: the images share one frame, or --initial-transform tells the placement");
        verb.path(
            "--initial-transform", o.initial_transform,
            "Where the alignment begins: a transform of ITK (.tfm, .txt, .h5, .mat), four rows of four numbers, or a "
            "displacement field; each from fixed to moving points, as ITK's (mm, LPS)");
        verb.flag("--no-error-estimate", o.no_error_estimate, "Leave out how far off targets may lie, for speed");
        verb.flag("--strict", o.strict, "End with exit code 4 where the result is doubted; everything is written");
        verb.flag("--resample-labels", o.resample_labels, "Accept labels on another grid than their image");
        verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>")
            ->check(CLI::Validator(check_device, "", "device"));
        verb.common(o.common);
        verb.module(o.common);
        verb.list(
                "--write", o.write, "NAME",
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
        verb.app().add_option("--config", "Read parameters from a TOML file; the command line wins")->type_name("FILE");
    }

    void declare_mesh(Verb& verb) {
        MeshOptions& o = mesh;
        verb.path("labels", o.labels, "Label map")->required();
        verb.path("-o,--output", o.output, "Mesh to write: .vtu (mm, LPS)")->required();
        verb.number("--edge-length", o.edge_length, "MM", 0.1, 100.0, "Target edge of the tetrahedra (mm)");
        verb.list("--label-edge-length", mesh_lengths, "LABEL=MM", "Target edge in one label (mm); repeatable")
            ->delimiter(',');
        verb.number("--facet-distance", o.facet_distance, "MM", 0.0, 100.0,
                    "Largest distance of facets to the interface (mm); 0: 0.12 edges, at least a quarter voxel");
        verb.number("--smoothing", o.smoothing, "VOXELS", 0.0, 10.0, "Gaussian that rounds the voxel steps (voxels)");
        verb.list("--only", o.only, "LABEL", "Labels to mesh; default: all but 0")->delimiter(',')->allow_extra_args();
        verb.choice(
            "--refinement", o.refinement, {"deterministic", "parallel"},
            "deterministic (one thread, the same mesh every time) or parallel (faster, another mesh every time)");
        verb.path("--json", o.json, "Also write the quality report as JSON");
        verb.common(o.common);
        verb.module(o.common);
    }

    void declare_warp(Verb& verb) {
        WarpOptions& o = warp;
        verb.path("input", o.input,
                  "Image, label map, points (.csv) or surface (.ply, .stl, .obj, .vtk, .vtp) of the moving frame")
            ->required();
        verb.path("-o,--output", o.output, "File to write")->required();
        CLI::Option* record = verb.path("--record", o.record, "record.h5 of a registration");
        CLI::Option* field =
            verb.path("--displacement", o.displacement,
                      "Displacement field (mm, LPS): fixed_to_moving for images and labels, moving_to_fixed "
                      "for points and surfaces");
        record->excludes(field);
        verb.path("--reference", o.reference,
                  "Image whose grid an image is warped onto, with --record; default: the input's");
        verb.flag("--labels", o.labels, "The image is a label map: nearest neighbour");
        verb.number("--outside", o.outside, "VALUE", -1e9, 1e9, "Value of voxels that come from outside the image");
        verb.number("--fade", o.fade, "MM", 1.0, 1e4, "Distance from the organ where the field has become rigid (mm)");
        verb.common(o.common);
        verb.module(o.common);
    }

    void declare_convert(Verb& verb) {
        ConvertOptions& o = convert;
        verb.app().footer(
            "Example:\n  tissuewarp convert out/transform.h5 warp.nii.gz\n"
            "  tissuewarp convert out/displacement_moving_to_fixed.nii.gz points.nrrd --from modeling");
        verb.path(
                "input", o.input,
                "Transform of ITK (.h5, .tfm, .txt, .mat), four rows of four numbers, or displacement field (mm, LPS)")
            ->required();
        verb.path("output", o.output,
                  "File to write: .h5, .tfm, .txt (linear), or a displacement field .nii.gz, .nrrd, .mha (mm, LPS)")
            ->required();
        for (const auto& [name, target, what] :
             {std::tuple{"--from", &o.from,
                         "What the input maps: resampling (fixed to moving points, as ITK's "
                         "transforms) or modeling (moving to fixed); default: what it says"},
              {"--to", &o.to, "What the output shall map; default: resampling, in .nrrd as the input"}})
            verb.choice(name, *target, {"modeling", "resampling"}, what);
        verb.path("--reference", o.reference, "Image whose grid a displacement field gets");
        verb.flag("--matrix", o.matrix, "In .txt four rows of four numbers, not ITK's text");
        verb.common(o.common);
    }

    void declare_evaluate(Verb& verb) {
        EvaluateOptions& o = evaluate;
        CLI::Option* labels = verb.path("--labels", o.labels, "Label map to score, for instance warped_labels.nii.gz");
        CLI::Option* reference = verb.path("--reference-labels", o.reference_labels, "Label map that is the truth");
        labels->needs(reference);
        reference->needs(labels);
        verb.path("--label-names", o.label_names, label_names_text)->needs(labels);
        verb.landmarks(o.landmarks);
        CLI::Option* field = verb.path("--displacement", o.displacement,
                                       "Field moving_to_fixed (mm, LPS): maps the landmarks, gives det J");
        verb.path("--inverse", o.inverse, "Field fixed_to_moving (mm, LPS): how far the two do not undo each other")
            ->needs(field);
        verb.path(
                "--mask", o.mask,
                "Only voxels other than 0 of this image, on the grid of --displacement, count for det J and --inverse")
            ->needs(field);
        verb.number("--moved", o.moved, "MM", 0.0, 1e3,
                    "Landmarks that moved by more than this are also summed up apart (mm)");
        CLI::Option* organ =
            verb.path("--moving-labels", o.moving_labels,
                      "Preoperative label map: sums up landmarks by depth below its surface; --held-out takes it too");
        verb.path("--data-surface", o.data_surface,
                  "Surface points that were registered to: sums up landmarks by distance to them (mm, LPS)");
        verb.path("--data-points", o.data_points,
                  "Points that were registered to, likewise: the file that register took as --fixed-points");
        verb.app()
            .add_option("--bin-edges", o.bin_edges, "Edges of the bins of depth and distance to data (mm)")
            ->type_name("MM")
            ->delimiter(',')
            ->capture_default_str();
        CLI::Option* moving_curves = verb.path("--moving-curves", o.moving_curves,
                                               "Preoperative centre lines of vessels, as register takes them");
        CLI::Option* fixed_curves =
            verb.path("--fixed-curves", o.fixed_curves,
                      "Intraoperative points along them: how far they lie from the lines, before and after");
        moving_curves->needs(fixed_curves);
        fixed_curves->needs(moving_curves);
        verb.path("--held-out", o.held_out,
                  "Intraoperative surface points that were not registered to: their distance to the warped surface of "
                  "--moving-labels; .ply, .stl, .obj, .vtk, .vtp, .csv, .xyz (mm, LPS)")
            ->needs(field)
            ->needs(organ);
        verb.path("--json", o.json, "Also write the scores as JSON");
        verb.common(o.common);
    }

    void declare_info(Verb& verb) {
        InfoOptions& o = info;
        verb.app()
            .add_option("files", info_files,
                        "Images, label maps, meshes (.vtu), surfaces or records (.h5); lengths in mm")
            ->type_name("FILE");
        verb.flag("--labels", o.labels, "Label statistics of an integer image (volumes in mm3)");
        verb.path("--label-names", o.label_names, label_names_text);
        verb.flag("--devices", o.devices, "List the EGL devices that --device gpu:<index> counts");
        verb.common(o.common);
    }

    void declare_bench(Verb& verb) {
        BenchOptions& o = bench;
        verb.choice("--study", o.study, {"cube", "brain", "scaling", "all"},
                    "cube (stretched, 100 mm), brain (indented by 10 mm), scaling (cubes) or all");
        verb.path("--labels", o.labels,
                  "Label map of the brain; default: data/brainshift/preop_labels.nii.gz if there");
        verb.app()
            .add_option("--label", o.only, "Labels that are brain; default: all but 0")
            ->type_name("LABEL")
            ->delimiter(',');
        verb.app()
            .add_option("--engines", o.engines,
                        "Of scalar, simd, render-passes, two-pass, fused; default: all that can run")
            ->type_name("NAME")
            ->delimiter(',');
        verb.app()
            .add_option("--elements", o.elements, "Sizes of the meshes, tetrahedra, of one study")
            ->type_name("COUNT")
            ->delimiter(',')
            ->check(CLI::Range(6, 40000000).description(""));
        verb.number("--steps", o.steps, "COUNT", 1, 1000000,
                    "Steps of a run, and after how many results are compared with float64");
        verb.number("--repeats", o.repeats, "COUNT", 2, 1000, "Runs of each engine on each mesh");
        verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>")
            ->check(CLI::Validator(check_device, "", "device"));
        verb.path("-o,--output", o.output, "Folder for bench.json, bench.csv and figures")->type_name("FOLDER");
        verb.flag("--quick", o.quick, "Small meshes, few steps: whether everything runs, not how fast");
        verb.common(o.common);
    }

    void declare_simulate(Verb& verb) {
        SimulateOptions& o = simulate;
        verb.app().footer("Example:\n  tissuewarp simulate --init cube\n  tissuewarp simulate cube.toml --output out");
        verb.path("scene", o.scene, "Scene file (TOML); with --init the file to write");
        verb.path("-o,--output", o.output, "Folder for the frames")->type_name("FOLDER");
        verb.text("--init", o.init, "Write a commented scene: brain-shift, breast, cube, liver, resection, retraction");
        verb.flag("--ablate", o.ablate, "Run without each effect in turn; print what it changes (mm) and costs (ms)");
        verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>; auto: what the scene says")
            ->check(CLI::Validator(check_device, "", "device"));
        verb.common(o.common);
        verb.module(o.common);
    }

    void declare_explain(Verb& verb) {
        ExplainOptions& o = explain;
        verb.path("scene", o.scene, "Scene file (TOML)")->required();
        verb.common(o.common);
    }

    void declare_calibrate(Verb& verb) {
        CalibrateOptions& o = calibrate;
        verb.path("-o,--output", o.output, "File to write; default: where register looks for it");
        verb.list("--problems", o.problems, "NAME", "phantom:FIRST-LAST; default: phantom:5001-5008");
        verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>")
            ->check(CLI::Validator(check_device, "", "device"));
        verb.flag("--quick", o.quick, "Two phantoms, two meshes: whether everything runs");
        verb.common(o.common);
    }

    void declare_study(Verb& verb) {
        StudyOptions& o = study;
        verb.app().footer("Example:\n  tissuewarp study accuracy-time --quick --output out/study");
        verb.text("name", o.name, "accuracy-time, coverage or dial")->required();
        verb.path("-o,--output", o.output, "Folder for measurements and page; a study interrupted there goes on")
            ->type_name("FOLDER");
        verb.list("--problems", o.problems, "NAME",
                  "Of cube, brain, brainshift, liver, phantom:SEED; dial: phantom:FIRST-LAST; coverage: that, "
                  "bent:FIRST-LAST, organ:FIRST-LAST or found:FIRST-LAST")
            ->delimiter(',');
        verb.list("--evidence", o.evidence, "KIND",
                  "What coverage registers to, of labels, surface, surface-and-points, points, curves, image, "
                  "degraded-image, partial-image, other-contrast; otherwise all of them")
            ->delimiter(',');
        verb.path("--organs", o.organs, "Label map whose organs organ:FIRST-LAST and found:FIRST-LAST take");
        verb.list("--fields", o.fields, "FILE", "Displacement fields of any program, which bend found:FIRST-LAST")
            ->delimiter(',');
        verb.path("--data", o.data, "Folder that holds phantom-liver, for the liver")->type_name("FOLDER");
        verb.number("--most-elements", o.most_elements, "COUNT", 1000, 2000000, "Leave larger meshes out");
        verb.number("--repeats", o.repeats, "COUNT", 0, 1000, "Runs of each point; 0: 5, with --quick 2");
        verb.flag("--quick", o.quick, "Small meshes, few points: whether the study runs, not how fast");
        verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>; auto: a GPU besides the processor if any")
            ->check(CLI::Validator(check_device, "", "device"));
        verb.common(o.common);
    }

    /// What CLI11 prints, with single blank lines.
    [[nodiscard]] std::string help() const {
        std::string text = app.help();
        for (std::size_t at; (at = text.find("\n\n\n")) != std::string::npos;) text.erase(at, 1);
        return text;
    }

    Command result() {
        const std::string verb = app.get_subcommands().front()->get_name();
        if (verb == "register") {
            registration.label_edge_length = label_lengths(register_lengths);
            registration.accuracy = quantity("--accuracy", accuracy, {{"mm", 1.0}});
            registration.time_budget = quantity("--time-budget", time_budget, {{"s", 1.0}, {"ms", 1e-3}});
            registration.anchors = label_list("--anchor", anchors);
            registration.rigid_neighbours = label_list("--rigid-neighbour", rigid_neighbours);
            if (registration.fixed_labels.empty() && registration.fixed_surface.empty() &&
                registration.point_pairs.fixed.empty() && registration.curves.fixed.empty())
                registration.match_image = true;
            if (registration.match_image && (registration.fixed.empty() || registration.moving.empty()))
                throw InvalidInput(
                    registration.fixed.empty()
                        ? "nothing to register to; give --fixed, --fixed-labels, --fixed-surface, --fixed-points or "
                          "--fixed-curves, or several (docs/which-data.md)"
                        : "matching the fixed image takes the moving one; give --moving");
            require_organ(registration);
            require_pairs(registration);
            require_what_is_written(registration);
            enter_bids_folder(registration);
            if (!registration.match_image && !(registration.moving_mask.empty() && registration.fixed_mask.empty()))
                throw InvalidInput(
                    "--moving-mask and --fixed-mask say what of the images is matched, and they are not; add "
                    "--match-image");
            registration.parameters = verbs.front().parameters({"save-parameters", "dry-run"});
            return registration;
        }
        if (verb == "mesh") {
            mesh.label_edge_length = label_lengths(mesh_lengths);
            return mesh;
        }
        if (verb == "warp") return warp;
        if (verb == "convert") return convert;
        if (verb == "evaluate") return evaluate;
        if (verb == "bench") return bench;
        if (verb == "simulate") return simulate;
        if (verb == "explain") return explain;
        if (verb == "calibrate") return calibrate;
        if (verb == "study") return study;
        info.files.assign(info_files.begin(), info_files.end());
        return info;
    }

    static void require_unmeshed(const RegisterOptions& o) {
        if (o.moving_mesh.empty()) return;
        if (o.edge_length > 0 || !o.label_edge_length.empty() || o.accuracy || o.time_budget)
            throw InvalidInput(
                "--moving-mesh is taken as it is; leave out --edge-length, --label-edge-length, --accuracy and "
                "--time-budget");
        if (!o.rigid_neighbours.empty())
            throw InvalidInput("--rigid-neighbour is not meshed, and --moving-mesh is; give --moving-labels instead");
    }

    /// Contrasts are matched pair by pair, and only where images are matched.
    static void require_pairs(const RegisterOptions& o) {
        if (o.moving_contrasts.empty() && o.fixed_contrasts.empty()) return;
        if (o.moving_contrasts.size() != o.fixed_contrasts.size())
            throw InvalidInput(fmt::format(
                "--moving is given {} times and --fixed {}; contrasts are matched pair by pair: give both as often",
                1 + o.moving_contrasts.size(), 1 + o.fixed_contrasts.size()));
        if (!o.match_image)
            throw InvalidInput("further contrasts are there to be matched, and images are not; add --match-image");
    }

    static void enter_bids_folder(RegisterOptions& o) {
        if (o.bids.empty()) return;
        o.output = o.output / bids_subject(o.bids) / "anat";
        if (!o.moving.empty()) bids_suffix(o.moving);
    }

    static void require_what_is_written(const RegisterOptions& o) {
        const auto names = [&](const char* word) {
            return std::find(o.write.begin(), o.write.end(), word) != o.write.end();
        };
        if (names("dicom") && !imaging::is_dicom(o.fixed))
            throw InvalidInput(
                "--write dicom writes objects that belong to the study of the fixed series; give --fixed as DICOM");
        if (names("markups") && !o.landmarks.given() && o.points.empty())
            throw InvalidInput(
                "--write markups writes points that are carried along, and there are none; give "
                "--landmarks or --points");
    }

    /// Something must say where the organ is, and what the numbers of other options mean.
    static void require_organ(const RegisterOptions& o) {
        require_unmeshed(o);
        if (!o.moving_labels.empty() || !o.moving_surface.empty() || !o.moving_mesh.empty()) return;
        if (o.moving.empty())
            throw InvalidInput(
                "nothing says where the organ is; give --moving-labels, --moving-surface, --moving-mesh or --moving "
                "(docs/which-data.md)");
        const auto refuse_without_labels = [](bool given, const std::string& option) {
            if (given)
                throw InvalidInput(option +
                                   " speaks of labels, and there are none of the moving image; give "
                                   "--moving-labels");
        };
        refuse_without_labels(!o.fixed_labels.empty(), "--fixed-labels");
        refuse_without_labels(!o.anchors.empty(), "--anchor");
        refuse_without_labels(!o.rigid_neighbours.empty(), "--rigid-neighbour");
    }

    /// Throws for a verb or a long option that does not exist, with the nearest that does: before CLI11 looks for what
    /// is required, which a misspelt option would seem to lack.
    void refuse_unknown(const std::vector<std::string>& arguments) {
        if (arguments.empty() || arguments.front().starts_with("-")) return;
        const auto verb =
            std::find_if(verbs.begin(), verbs.end(), [&](Verb& v) { return v.app().get_name() == arguments.front(); });
        if (verb == verbs.end())
            refuse("there is no verb '" + arguments.front() + "'", arguments.front(), verb_names(), "--help");
        std::vector<std::string> names;
        for (const CLI::Option* option : verb->app().get_options())
            for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
        for (const std::string& argument : arguments) {
            const std::string name = argument.substr(0, argument.find('='));
            if (name.starts_with("--") && std::find(names.begin(), names.end(), name) == names.end())
                refuse("there is no option '" + name + "'", name, names, arguments.front() + " --help-all");
        }
    }

    [[noreturn]] static void refuse(const std::string& message, const std::string& word,
                                    const std::vector<std::string>& names, const std::string& help) {
        const std::string nearest = nearest_name(word, names);
        throw InvalidInput(message +
                           (nearest.empty() ? "; see 'tissuewarp " + help + "'" : "; did you mean '" + nearest + "'?"));
    }

    /// The verb that the arguments name, where it is a command-line module; or null.
    [[nodiscard]] const Verb* module(const std::vector<std::string>& arguments) const {
        const auto named = std::find_if(verbs.begin(), verbs.end(), [&](const Verb& verb) {
            return !arguments.empty() && verb.name() == arguments.front() && verb.is_module();
        });
        return named == verbs.end() ? nullptr : &*named;
    }

    static std::vector<std::string> verb_names() {
        return {"register", "mesh",     "warp",    "convert",   "evaluate", "info",
                "bench",    "simulate", "explain", "calibrate", "study"};
    }
};

}  // namespace

Command parse_command_line(std::vector<std::string> arguments) {
    Parser parser;
    const Verb* module = parser.module(arguments);
    if (module) arguments = with_hyphens(std::move(arguments));
    if (!arguments.empty() && arguments.front() == "register")
        arguments = with_config(arguments, parser.verbs.front().known());
    parser.refuse_unknown(arguments);
    if (module && std::find(arguments.begin(), arguments.end(), "--xml") != arguments.end())
        throw HelpRequest{module->description()};
    std::reverse(arguments.begin(), arguments.end());  // CLI11 takes them last first
    try {
        parser.app.parse(arguments);
    } catch (const CLI::CallForAllHelp&) {
        throw HelpRequest{parser.help()};
    } catch (const CLI::CallForHelp&) {
        for (Verb& verb : parser.verbs) verb.shorten_help();
        throw HelpRequest{parser.help()};
    } catch (const CLI::CallForVersion&) {
        throw HelpRequest{parser.app.version() + "\n"};
    } catch (const CLI::ParseError& error) {
        const bool no_verb = parser.app.get_subcommands().empty();
        throw InvalidInput(no_verb ? "give a verb: register, mesh, warp, convert, evaluate, info, bench, simulate, "
                                     "explain, calibrate or study; "
                                     "see 'tissuewarp --help'"
                                   : fmt::format("{}; see 'tissuewarp {} --help-all'", error.what(),
                                                 parser.app.get_subcommands().front()->get_name()));
    }
    return parser.result();
}

std::string verb_of(const std::vector<std::string>& arguments) {
    const auto verbs = Parser::verb_names();
    const bool known = !arguments.empty() && std::find(verbs.begin(), verbs.end(), arguments.front()) != verbs.end();
    return known ? arguments.front() : "";
}

}  // namespace tissuewarp::apps
