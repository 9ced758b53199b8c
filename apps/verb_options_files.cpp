// Options of the verbs that read and write files of other programs.

#include "apps/verb_options.hpp"

#include <tuple>

namespace tissuewarp::apps {

void declare_mesh(Verb& verb, MeshOptions& o, std::vector<std::string>& mesh_lengths) {
    verb.path("labels", o.labels, "Label map")->required();
    verb.path("-o,--output", o.output, "Mesh to write: .vtu (mm, LPS)")->required();
    verb.number("--edge-length", o.edge_length, "MM", 0.1, 100.0, "Target edge of the tetrahedra (mm)");
    verb.list("--label-edge-length", mesh_lengths, "LABEL=MM", "Target edge in one label (mm); repeatable")
        ->delimiter(',');
    verb.number("--facet-distance", o.facet_distance, "MM", 0.0, 100.0,
                "Largest distance of facets to the interface (mm); 0: 0.12 edges, at least a quarter voxel");
    verb.number("--smoothing", o.smoothing, "VOXELS", 0.0, 10.0, "Gaussian that rounds the voxel steps (voxels)");
    verb.list("--only", o.only, "LABEL", "Labels to mesh; default: all but 0")->delimiter(',')->allow_extra_args();
    verb.choice("--refinement", o.refinement, {"deterministic", "parallel"},
                "deterministic (one thread, the same mesh every time) or parallel (faster, another mesh every time)");
    verb.path("--json", o.json, "Also write the quality report as JSON");
    verb.common(o.common);
    verb.module(o.common);
}

void declare_warp(Verb& verb, WarpOptions& o) {
    verb.path("input", o.input,
              "Image, label map, points (.csv) or surface (.ply, .stl, .obj, .vtk, .vtp) of the moving frame")
        ->required();
    verb.path("-o,--output", o.output, "File to write")->required();
    CLI::Option* record = verb.path("--record", o.record, "record.h5 of a registration");
    CLI::Option* field =
        verb.path("--displacement", o.displacement,
                  "Displacement field (mm, LPS): fixed_to_moving for images and labels, moving_to_fixed "
                  "for points and surfaces; or displacement.h5 of a scene");
    record->excludes(field);
    verb.number("--frame", o.frame, "N", -1, 1000000, "Frame of a scene's displacement.h5: 0 at rest, -1 the last")
        ->needs(field);
    verb.path("--reference", o.reference,
              "Image whose grid an image is warped onto; default: the input's, or that of a field");
    verb.flag("--labels", o.labels, "The image is a label map: nearest neighbour");
    verb.number("--outside", o.outside, "VALUE", -1e9, 1e9, "Value of voxels that come from outside the image");
    verb.number("--fade", o.fade, "MM", 1.0, 1e4, "Distance from the organ where the field has become rigid (mm)");
    verb.common(o.common);
    verb.module(o.common);
}

void declare_convert(Verb& verb, ConvertOptions& o) {
    verb.app().footer(
        "Example:\n  tissuewarp convert out/transform.h5 warp.nii.gz\n"
        "  tissuewarp convert out/displacement_moving_to_fixed.nii.gz points.nrrd --from modeling");
    verb.path("input", o.input,
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

void declare_compound(Verb& verb, CompoundOptions& o) {
    verb.app().footer(
        "Example:\n  tissuewarp compound sweep.mha -o ultrasound.nii.gz\n"
        "  tissuewarp compound sweep.mha -o ultrasound.nii.gz --calibration PlusDeviceSet.xml --to Tracker");
    verb.path("input", o.input, "Tracked frames as Plus and 3D Slicer write them: .mha, .mhd")->required();
    verb.path("-o,--output", o.output, "Volume to write: .nii.gz, .nii, .nrrd, .mha")->required();
    verb.text("--to", o.to, "Coordinate system of the patient, in which the volume shall lie");
    verb.choice("--axes", o.axes, {"ras", "lps"}, "Axes of that system");
    verb.path("--calibration", o.calibration,
              "From pixels to mm of the probe, where the sweep has no ImageToProbe, or another: 16 numbers, or a "
              "configuration of Plus");
    verb.number("--spacing", o.spacing, "MM", 0.05, 10.0, "Voxels of the volume (mm)");
    verb.number("--gap", o.gap, "MM", 0.0, 100.0, "Frames farther apart have nothing between them (mm)");
    verb.common(o.common);
}

void declare_evaluate(Verb& verb, EvaluateOptions& o) {
    CLI::Option* labels = verb.path("--labels", o.labels, "Label map to score, for instance warped_labels.nii.gz");
    CLI::Option* reference = verb.path("--reference-labels", o.reference_labels, "Label map that is the truth");
    labels->needs(reference);
    reference->needs(labels);
    verb.path("--label-names", o.label_names, label_names_text)->needs(labels);
    verb.landmarks(o.landmarks);
    CLI::Option* field =
        verb.path("--displacement", o.displacement, "Field moving_to_fixed (mm, LPS): maps the landmarks, gives det J");
    verb.path("--inverse", o.inverse, "Field fixed_to_moving (mm, LPS): how far the two do not undo each other")
        ->needs(field);
    verb.path("--mask", o.mask,
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
    CLI::Option* moving_curves =
        verb.path("--moving-curves", o.moving_curves, "Preoperative centre lines of vessels, as register takes them");
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

void declare_info(Verb& verb, InfoOptions& o, std::vector<std::string>& info_files) {
    verb.app()
        .add_option("files", info_files,
                    "Images, label maps, meshes (.vtu), surfaces, records (.h5) or patients (.tw); lengths in mm")
        ->type_name("FILE");
    verb.flag("--labels", o.labels, "Label statistics of an integer image (volumes in mm3)");
    verb.path("--label-names", o.label_names, label_names_text);
    verb.flag("--devices", o.devices, "List the EGL devices that --device gpu:<index> counts");
    verb.common(o.common);
}

}  // namespace tissuewarp::apps
