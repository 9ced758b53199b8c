#pragma once
/// What the command line of each verb says, as plain structs. The parser is known to options.cpp and verb_options_*.cpp
/// alone.

#include "apps/parameters.hpp"

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace tissuewarp::apps {

/// What every verb understands.
struct CommonOptions {
    int threads = 0;                               ///< 0: all cores
    bool quiet = false;                            ///< errors only
    std::filesystem::path return_parameters = {};  ///< what 3D Slicer reads back; or empty
    std::string process_information = {};          ///< where 3D Slicer keeps progress, in its own memory; or empty
    /// 3D Slicer runs this verb and reads progress on standard output.
    [[nodiscard]] bool tells_progress() const { return !(return_parameters.empty() && process_information.empty()); }
};

/// Where the time steps run.
struct DeviceChoice {
    std::string name = "auto";  ///< "auto", "cpu", "gpu" or "gpu:<n>", n counting EGL devices
};

/// Known correspondences, for scoring only: one CSV, or a pair of point files of elastix or 3D Slicer.
struct LandmarkFiles {
    std::filesystem::path csv, moving, fixed;
    [[nodiscard]] bool given() const { return !csv.empty() || !moving.empty(); }
};

/// Points of the tissue in both images, to register to: one CSV, or a pair of point files likewise.
struct PointPairFiles {
    std::filesystem::path moving, fixed;  ///< moving is empty with one CSV
    double deviation = 1.0;               ///< mm
};

/// Centre lines of vessels in the moving image, and points along them seen during the operation; all or none.
struct CurveFiles {
    std::filesystem::path moving, fixed;
    double deviation = 1.0;  ///< mm
};

/// What is known before the operation, and how the model is made of it.
struct PreoperativeOptions {
    std::filesystem::path moving, moving_labels;
    std::vector<std::filesystem::path> moving_contrasts;  ///< further images, in their order
    std::filesystem::path moving_surface, moving_mesh;    ///< of the organ; one of labels, surface and mesh, or none:
                                                          ///< the foreground of the image
    std::filesystem::path moving_mask;                    ///< 0 where the image may not be matched
    std::filesystem::path label_names;                    ///< a colour table or label file
    double edge_length = 0.0;                             ///< mm; 0: from the volume of the organ and what is given
    std::map<int, double> label_edge_length;              ///< mm
    std::filesystem::path materials;
    std::string tissue = "default";           ///< of registration/tissues.hpp: of labels that nothing else tells of
    std::map<int, std::string> label_tissue;  ///< of single labels
    double default_youngs_modulus = 3.0;      ///< kPa
    double default_poissons_ratio = 0.45;
    std::string element = "auto";                          ///< "auto", "t4" or "averaged-pressure"
    std::vector<int> anchors, rigid_neighbours, resected;  ///< labels of the preoperative map
    std::vector<std::array<int, 2>> sliding;               ///< pairs of them
    double data_stiffness = 3.0;                           ///< kPa/mm
};

/// What is seen during the operation, how the model is registered to it, and what is told of the result.
struct IntraoperativeOptions {
    std::filesystem::path fixed, fixed_labels;
    std::vector<std::filesystem::path> fixed_contrasts;  ///< further images, each a pair with one of the moving ones
    std::filesystem::path fixed_mask;                    ///< 0 where the image may not be matched
    std::filesystem::path fixed_surface;                 ///< points of a part of the organ's surface
    double surface_deviation = 1.0;                      ///< mm
    PointPairFiles point_pairs;
    CurveFiles curves;
    LandmarkFiles landmarks;
    std::filesystem::path initial_transform;  ///< fixed → moving points
    std::filesystem::path points, surface;    ///< of the moving frame, carried along
    int rounds = 8;
    double tolerance = 0.05;          ///< mm
    double fade = 60.0;               ///< mm
    std::string similarity = "auto";  ///< "auto", "self-similarity" or "linear-combination"
    bool match_image = false;         ///< implied where the fixed image is all there is
    bool no_align = false;
    bool no_error_estimate = false;
    bool strict = false;  ///< a result that is doubted ends with exit code 4
    DeviceChoice device;
};

struct RegisterOptions : PreoperativeOptions, IntraoperativeOptions {
    CommonOptions common;
    std::filesystem::path output;
    std::optional<double> accuracy, time_budget;  ///< mm; s: they choose the mesh
    bool resample_labels = false;
    bool find_resected = false;  ///< what is gone is sought in what was seen
    bool dry_run = false;
    std::string bids;                ///< subject: results in BIDS' folders under its names; `output` is the innermost
    std::vector<std::string> write;  ///< words of output_names.hpp: files beside the usual ones
    std::filesystem::path save_parameters;
    std::vector<Parameter> parameters;  ///< all of the above as written to files
};

struct PrepareModelOptions {
    CommonOptions common;
    PreoperativeOptions preoperative;
    bool resample_labels = false;
    bool for_labels = false;  ///< the mesh is as fine as labels of the operation make use of
    std::filesystem::path output;
    std::vector<Parameter> parameters;  ///< as those of register
};

struct UpdatePatientOptions {
    CommonOptions common;
    std::filesystem::path patient;
    RegisterOptions registration;  ///< its preoperative part is that of the patient
};

struct ServeOptions {
    CommonOptions common;
    std::filesystem::path patient, log, folder, replay;
    std::filesystem::path targets;  ///< points of the moving frame, carried along
    std::string address = "127.0.0.1";
    int port = 18944;
    DeviceChoice device;
};

struct MeshOptions {
    CommonOptions common;
    std::filesystem::path labels, output, json;
    double edge_length = 5.0;                 ///< mm
    std::map<int, double> label_edge_length;  ///< mm
    double facet_distance = 0.0;              ///< mm, 0: chosen from the edge length
    double smoothing = 0.8;                   ///< voxels
    std::vector<int> only;                    ///< labels to mesh; empty: all
    std::string refinement = "deterministic";
};

struct WarpOptions {
    CommonOptions common;
    std::filesystem::path input, output, record, displacement, reference;
    int frame = -1;        ///< of a scene's displacement.h5; -1: the last
    bool labels = false;   ///< nearest neighbour
    double outside = 0.0;  ///< value of voxels whose tissue lay outside the moving image
    double fade = 60.0;    ///< mm, without a field on a grid
};

struct ConvertOptions {
    CommonOptions common;
    std::filesystem::path input, output, reference;
    std::string from, to;  ///< "modeling", "resampling", or empty: as the files say
    bool matrix = false;   ///< four rows of four numbers, not ITK's text
};

struct CompoundOptions {
    CommonOptions common;
    std::filesystem::path input, output, calibration;
    std::string to = "Reference";   ///< coordinate system of the patient
    std::string axes = "ras";       ///< its axes
    double spacing = 0.5, gap = 3;  ///< mm
};

struct EvaluateOptions {
    CommonOptions common;
    std::filesystem::path labels, reference_labels, label_names, displacement, inverse, mask, json;
    LandmarkFiles landmarks;
    double moved = 2.0;                                 ///< mm
    std::filesystem::path moving_labels;                ///< where the organ's surface is, moving frame
    std::filesystem::path data_surface, data_points;    ///< what was registered to, fixed frame
    std::filesystem::path moving_curves, fixed_curves;  ///< centre lines of vessels, and points along them
    std::filesystem::path held_out;                     ///< surface points that were not registered to, fixed frame
    std::vector<double> bin_edges{5, 10, 20};           ///< mm, of depths and distances to data
};

struct InfoOptions {
    CommonOptions common;
    std::vector<std::filesystem::path> files;
    bool labels = false, devices = false;
    std::filesystem::path label_names;  ///< a colour table or label file
};

struct BenchOptions {
    CommonOptions common;
    std::string study = "all";             ///< "cube", "brain", "scaling" or "all"
    std::filesystem::path labels, output;  ///< label map of the brain; folder for JSON, CSV and figures, or empty
    std::vector<int> only;                 ///< labels that are brain; empty: all but 0
    std::vector<std::string> engines;      ///< empty: all
    std::vector<int> elements;             ///< sizes of the meshes of one study; empty: those of the study
    int steps = 1000;
    int repeats = 5;
    bool quick = false;
    DeviceChoice device;
};

struct SimulateOptions {
    CommonOptions common;
    std::filesystem::path scene, output;
    std::string init;     ///< name of a scene to write
    bool ablate = false;  ///< what each effect changes, in place of frames
    DeviceChoice device;
};

struct ExplainOptions {
    CommonOptions common;
    std::filesystem::path scene;
};

struct CalibrateOptions {
    CommonOptions common;
    std::filesystem::path output;       ///< empty: where register looks
    std::vector<std::string> problems;  ///< "phantom:FIRST-LAST"; empty: eight
    bool quick = false;
    DeviceChoice device;
};

struct CohortOptions {
    CommonOptions common;  ///< threads: of each job; 0: the cores over the jobs
    std::filesystem::path table, output;
    int jobs = 0;                      ///< at a time; 0: as the machine has cores or devices, or as Slurm likes
    std::string slurm;                 ///< partition, or empty: this machine
    std::vector<std::string> devices;  ///< "gpu:<n>", n counting EGL devices
    int per_device = 1;                ///< jobs that share a device
    std::string frame;                 ///< patient in whose frame the group's mean is made, or empty
    bool dry_run = false;
};

struct StudyOptions {
    CommonOptions common;
    std::string name;                    ///< of the study
    std::filesystem::path output, data;  ///< folder of results, which an interrupted study goes on in; shared phantoms
    std::vector<std::string> problems;  ///< "cube", "brain", "brainshift", "liver", "phantom:SEED"; empty: of the study
    std::vector<std::string> evidence;  ///< what coverage registers to; empty: every kind
    std::filesystem::path organs;       ///< label map whose organs "organ:SEED" and "found:SEED" take
    std::vector<std::string> fields;    ///< files of displacements, one of which bends "found:SEED"
    int most_elements = 500000;         ///< of a mesh
    int repeats = 0;                    ///< 0: of the study
    bool quick = false;
    DeviceChoice device;
};

using Command = std::variant<RegisterOptions, PrepareModelOptions, UpdatePatientOptions, ServeOptions, MeshOptions,
                             WarpOptions, ConvertOptions, CompoundOptions, EvaluateOptions, InfoOptions, BenchOptions,
                             SimulateOptions, ExplainOptions, CalibrateOptions, StudyOptions, CohortOptions>;

/// The text that --help or --version asked for; not an error.
struct HelpRequest {
    std::string text;
};

/// Parses the arguments after the program's name. Throws InvalidInput with one line, HelpRequest for --help.
Command parse_command_line(std::vector<std::string> arguments);

/// "register", "mesh", ... or nothing when the first argument names no verb: for the prefix of error messages.
std::string verb_of(const std::vector<std::string>& arguments);

}  // namespace tissuewarp::apps
