// Options of simulations and studies.

#include "apps/verb_options.hpp"

#include "apps/option_values.hpp"

namespace tissuewarp::apps {

void declare_bench(Verb& verb, BenchOptions& o) {
    verb.choice("--study", o.study, {"cube", "brain", "scaling", "all"},
                "cube (stretched, 100 mm), brain (indented by 10 mm), scaling (cubes) or all");
    verb.path("--labels", o.labels, "Label map of the brain; default: data/brainshift/preop_labels.nii.gz if there");
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

void declare_simulate(Verb& verb, SimulateOptions& o) {
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

void declare_explain(Verb& verb, ExplainOptions& o) {
    verb.path("scene", o.scene, "Scene file (TOML)")->required();
    verb.common(o.common);
}

void declare_calibrate(Verb& verb, CalibrateOptions& o) {
    verb.path("-o,--output", o.output, "File to write; default: where register looks for it");
    verb.list("--problems", o.problems, "NAME", "phantom:FIRST-LAST; default: phantom:5001-5008");
    verb.text("--device", o.device.name, "auto, cpu, gpu or gpu:<index>")
        ->check(CLI::Validator(check_device, "", "device"));
    verb.flag("--quick", o.quick, "Two phantoms, two meshes: whether everything runs");
    verb.common(o.common);
}

void declare_cohort(Verb& verb, CohortOptions& o) {
    verb.app().footer("Example:\n  tissuewarp cohort table.csv --output cohort --jobs 2");
    verb.path("table", o.table, "CSV table: a row for each pair, a column for each option of register")->required();
    verb.path("-o,--output", o.output, "Folder for all pairs and the cohort's page; a cohort interrupted there goes on")
        ->type_name("FOLDER")
        ->required();
    CLI::Option* slurm = verb.text("--slurm", o.slurm, "Run as arrays of Slurm in this partition");
    slurm->type_name("PARTITION")->default_str("");
    verb.number("--jobs", o.jobs, "COUNT", 0, 100000,
                "Pairs at a time; 0: half of the cores, all places on devices, or with --slurm as many as it lets");
    verb.list("--devices", o.devices, "gpu:INDEX", "GPUs of this machine to share out, by their EGL index")
        ->delimiter(',');
    verb.number("--per-device", o.per_device, "COUNT", 1, 64, "Pairs that share a device at a time");
    verb.text("--frame", o.frame, "Patient of the columns 'from' and 'to' in whose frame the group's mean is made")
        ->type_name("PATIENT")
        ->default_str("");
    verb.flag("--dry-run", o.dry_run, "Check the whole table, say what it would take, write nothing");
    verb.common(o.common);
}

void declare_study(Verb& verb, StudyOptions& o) {
    verb.app().footer("Example:\n  tissuewarp study accuracy-time --quick --output out/study");
    verb.text("name", o.name, "accuracy-time, coverage, dial or patient")->required();
    verb.path("-o,--output", o.output, "Folder for measurements and page; a study interrupted there goes on")
        ->type_name("FOLDER");
    verb.list("--problems", o.problems, "NAME",
              "Of cube, brain, brainshift, liver, phantom:SEED; dial: phantom:FIRST-LAST; coverage: that, "
              "bent:FIRST-LAST, ultrasound:FIRST-LAST, tracked-ultrasound:FIRST-LAST, faint-ultrasound:FIRST-LAST, "
              "resected:FIRST-LAST, opened:FIRST-LAST, "
              "unresected:FIRST-LAST, bulged:FIRST-LAST, sought:FIRST-LAST, untold:FIRST-LAST, turned:FIRST-LAST, "
              "organ:FIRST-LAST or found:FIRST-LAST")
        ->delimiter(',');
    verb.list("--evidence", o.evidence, "KIND",
              "What coverage registers to, of labels, surface, surface-and-points, points, curves, image, "
              "degraded-image, partial-image, other-contrast, ultrasound; otherwise all but the last")
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

}  // namespace tissuewarp::apps
