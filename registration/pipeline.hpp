#pragma once
/// The method: prepare the patient's model before the operation, update it from what is seen during it.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/mesher.hpp"
#include "registration/alignment.hpp"
#include "registration/correspondence.hpp"
#include "registration/deformation.hpp"
#include "registration/image_matching.hpp"
#include "registration/intraoperative.hpp"
#include "tled/equilibrium.hpp"
#include "tled/model.hpp"

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::registration {

/// Seconds spent in a named stage.
struct StageTime {
    std::string stage;
    double seconds = 0;
};

/// Edge (mm) of a cube of the labelled voxels' volume.
double organ_size(const imaging::Volume& labels);

/// Edge length (mm) that cuts an organ of the map's volume into about 50 000 tetrahedra: organ_size over 18. Boundaries
/// of a label map pull at every node of the surface, which should lie on it.
double suggested_edge_length(const imaging::Volume& labels);

/// The same into about 15 000, over 12: where an image or points pull, without labels. Finer tetrahedra cost three to
/// ten times the seconds and are no more accurate (docs/results.md, "How fine a mesh").
double suggested_edge_length_without_labels(const imaging::Volume& labels);

/// Edge length 0: that of suggested_edge_length. A function, because GCC 12 warns of uninitialised members where a
/// designated initialiser stands in its place.
inline meshing::MeshingOptions automatic_edge_length() {
    meshing::MeshingOptions options;
    options.edge_length = 0;
    return options;
}

struct PrepareOptions {
    meshing::MeshingOptions meshing = automatic_edge_length();
    tled::MaterialTable materials;  ///< labels without an entry take `default_material`
    tled::Material default_material = tled::neo_hookean_lnj(3.0, 0.45);
    std::optional<tled::Element> element;  ///< default: tled::suggested_element
    double data_stiffness = 3.0;           ///< kPa/mm along the normal per interface area, at full weight
    double tangential_ratio = 0.02;        ///< stiffness along the surface over stiffness along the normal
    std::vector<int> anchors;              ///< labels of tissue that stays where the rigid placement has it
    std::vector<int> rigid_neighbours;     ///< labels of bodies that move with the placement and are not meshed; the
                                           ///< organ slides along them and comes off, but does not enter them
};

/// Throws InvalidInput, naming the label and those present, unless the map holds every anchor and rigid neighbour, none
/// is both or 0, and something else is left to register.
void require_surroundings(const imaging::Volume& moving_labels, const PrepareOptions& options);

/// What the preoperative image shows of the tissue, to be found again in a bare intraoperative volume.
struct ImageModel {
    imaging::Volume image;
    MatchingTemplate blocks;
};

struct ImageModelOptions {
    FeatureOptions features;
    TemplateOptions blocks;
};

/// Bone and the like about the organ, on the grid of the preoperative label map.
struct RigidNeighbours {
    imaging::Volume labels;    ///< theirs alone
    imaging::Volume distance;  ///< mm to the nearest of them, negative within; float32
};

/// Everything that does not depend on intraoperative data.
struct PreparedModel {
    tled::Model model;       ///< mesh in LPS mm of the preoperative image
    imaging::Volume labels;  ///< the preoperative label map it came from, without rigid neighbours
    PrepareOptions options;
    Interfaces interfaces;
    tled::RestState rest;
    tled::RestStiffness stiffness;  ///< K₀ with all interface springs at full weight
    std::vector<StageTime> times;
    std::optional<ImageModel> image;  ///< see prepare_image
    std::optional<RigidNeighbours> neighbours;
    std::unique_ptr<PreparedModel> coarse;  ///< of the same organ, see prepare_loads
};

/// Label map → mesh → rest state → rest stiffness, its pattern analysed. Throws InvalidInput, Cancelled.
PreparedModel prepare(const imaging::Volume& moving_labels, const PrepareOptions& options = {},
                      Observer& observer = silent_observer());

/// The same for a mesh that exists already.
PreparedModel prepare(meshing::TetMesh mesh, const imaging::Volume& moving_labels, const PrepareOptions& options = {},
                      Observer& observer = silent_observer());

/// The same model of other tissue: rest state and stiffness are made anew, its coarser one's too. Throws InvalidInput
/// for materials that do not fit the model.
PreparedModel with_materials(PreparedModel prepared, const tled::MaterialTable& materials);

/// Adds what registering to a bare intraoperative volume takes: blocks of the preoperative image about feature points
/// in and near the labels. Throws InvalidInput, Cancelled.
void prepare_image(PreparedModel& prepared, const imaging::Volume& moving, const ImageModelOptions& options = {},
                   Observer& observer = silent_observer());

/// Adds what updates take that look for loads which nobody stated, from labels alone or from points of a free organ: of
/// a model of more than 6000 nodes a coarser one, with edges of suggested_edge_length_without_labels, on which they are
/// found. Without it the first such update makes one, in seconds. Adds nothing to a smaller model, nor to one that
/// anchors or rigid neighbours hold, whose loads are not looked for. Throws InvalidInput, Cancelled.
void prepare_loads(PreparedModel& prepared, Observer& observer = silent_observer());

enum class Device { Auto, Cpu, Gpu };

/// How blocks of a bare volume are searched and weighed (docs/method.md, section 8).
struct ImageOptions {
    BlockMatchingOptions matching;
    ConsistencyOptions consistency;
    /// After the search for blocks, dense searches on grids so many times doubled from the blocks' finest.
    std::vector<int> dense_coarsening{1, 1, 0};
    double expected_motion_mm = 100;  ///< of the organ's surface in the field of view of the intraoperative image
    double unseen_motion_mm = 0.8;    ///< and out of it, along its normal: what is around holds it there, …
    double unseen_slide_mm = 4;       ///< … and lets it slide along itself
    double headers_within_mm = 15;    ///< the headers place an organ, part of which is out of view, closer than this
};

/// What is expected of tissue before anything is seen. It weighs strain energy against matches and points, and holds
/// what no datum shows.
struct TissuePrior {
    double expected_strain = 0.12;  ///< deviation of the strain of pieces of tissue …
    double strain_length_mm = 10;   ///< … of this size
    double free_motion_mm = 20;     ///< of the organ's surface, from where the organ lies as a whole
    double held_motion_mm = 5;      ///< the same where the images are in one frame: what is around holds the organ
    int load_shapes = 48;  ///< of unknown loads that move what points do not show, where the placement is free; 0:
                           ///< none, and no unknown weight where labels are seen
};

/// What acts on the tissue in the operating room and did not when the preoperative image was taken. Only its size
/// relative to Young's modulus tells in a displacement.
struct TissueLoads {
    Eigen::Vector3d body_force =
        Eigen::Vector3d::Zero();  ///< ρ times the change of gravity, mN/mm³ in the moving frame
    double pressure_kpa = 0;      ///< on the model's outer surface at rest; above 0 it presses inward
};

/// How points of a surface are weighed.
struct SurfaceOptions {
    double patch_mm = 10;           ///< size of a piece of surface whose points say one thing together
    double max_angle_deg = 60;      ///< between the normals of a point and of the model
    double outlier_deviations = 3;  ///< Geman–McClure scale of the last round, in standard deviations of a point
};

/// How pairs of points are weighed.
struct PointOptions {
    double outlier_deviations = 3;  ///< Geman–McClure scale of the last round, in standard deviations of a pair
};

/// How points along vessels are weighed.
struct CurveOptions {
    double step_mm = 1;             ///< between samples of the preoperative lines
    double piece_mm = 5;            ///< length of a piece of vessel whose points say one thing together: its width
    double max_angle_deg = 45;      ///< between a point's tangent and the line's, where both are known
    double outlier_deviations = 3;  ///< Geman–McClure scale of the last round, in standard deviations of a point
};

struct UpdateOptions {
    ImageOptions image;
    TissuePrior tissue;
    TissueLoads loads;
    SurfaceOptions surface;
    PointOptions points;
    CurveOptions curves;
    AlignmentOptions alignment;
    bool align = true;             ///< false: the images are in one frame already
    int rematches = 8;             ///< rounds of correspondence and equilibrium; up to twice as many when the
                                   ///< step bound holds the surface back
    double settled_mm = 0.15;      ///< a round that moves no node further is followed by the last one; before a search
                                   ///< for blocks, a quarter of its range suffices
    double most_step_mm = 6.0;     ///< most that one round asks a surface node to move
    double first_range_mm = 15.0;  ///< correspondence search range of the first round
    double last_range_mm = 4.0;    ///< and of the last, geometric in between
    double max_angle_deg = 50.0;   ///< between mesh normal and image boundary normal
    double residual_scale_mm = 1.0;  ///< of the last round's weights for what a label map or an image shows wrongly
    /// Seconds that an update may take. When they run short the last round comes early, and where they do not suffice
    /// for that either, the rounds end: the result then says so. 0: as long as it takes.
    double time_budget_s = 0;
    tled::EquilibriumOptions equilibrium;
    Device device = Device::Auto;
    int gpu_index = -1;  ///< EGL device, −1: the first with hardware
};

/// What a round of correspondence and equilibrium did.
struct Round {
    double range_mm = 0;
    int matched = 0, interface_nodes = 0;
    int held_back = 0;             ///< matches further away than the round's step bound
    double mean_residual_mm = 0;   ///< along the normal, after equilibrium, weighted
    double largest_change_mm = 0;  ///< of a node since the round before
    int force_evaluations = 0;
    double estimated_error_mm = 0;  ///< lifted residual at acceptance
};

/// How points of a surface agree with the registered model.
struct SurfaceFit {
    double inlier_share = 0;     ///< of the points: within the scale of the last round
    double residual_mm = 0;      ///< root mean square of those, along normals
    double coverage = 0;         ///< the area they stand for over that of the model's surface
    bool pose_searched = false;  ///< among all places, not only near the headers'
    double rival_mm = 0;         ///< how far the surface lies from the chosen start pose in the best other one, mean
    double rival_support = 0;    ///< what that one explains of the points over what the chosen one explains
};

/// What was found of the preoperative image's blocks.
struct ImageFit {
    int blocks = 0, matched = 0;
    double residual_mm = 0;  ///< of the last round, weighted by confidence
    double shown_share = 0;  ///< of the model's nodes: no further than 15 mm from a match
    /// Σ ∇D₁·∇D₂ over Σ ½ (|∇D₁|² + |∇D₂|²) of the images' descriptors, before the last rounds: 1 for the same image,
    /// near 0 for images of different things. None where no dense search was made.
    std::optional<double> agreement;
};

/// How pairs of points agree with the registered model.
struct PointFit {
    int used = 0;            ///< pairs whose moving point lies in the model
    int outliers = 0;        ///< of those: beyond the scale of the last round
    double residual_mm = 0;  ///< root mean square of the others
};

/// How points along vessels agree with the registered model.
struct CurveFit {
    int points = 0;           ///< that were taken
    double inlier_share = 0;  ///< of them: within the scale of the last round of a line
    double residual_mm = 0;   ///< root mean square of those, across the line
    double length_mm = 0;     ///< of the preoperative lines in the model
};

/// How the organ lies to its rigid neighbours.
struct ContactFit {
    int touching = 0;       ///< surface nodes that a neighbour holds back
    double deepest_mm = 0;  ///< that a surface node lies in a neighbour, beyond where it lay at rest
};

/// How anchored tissue stayed where it was.
struct AnchorFit {
    int nodes = 0;
    double largest_mm = 0;  ///< displacement of one of them
};

/// What pulled at the tissue in the last round.
struct LastPulls {
    std::vector<tled::Spring> data;
    std::vector<tled::Spring> holds;     ///< where labels pull: to where nodes were before the round, which is no datum
    std::vector<tled::Spring> ground;    ///< the prior where points alone show the organ; otherwise none
    std::vector<tled::Spring> supports;  ///< anchors, and contact with rigid neighbours
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed, as it was in that round
    Eigen::Matrix3Xd loads;                                       ///< on the nodes, 3 × N, mN, those found among them
    double energy = 1;            ///< mN mm that weighs as much as one standard deviation of a datum
    bool free_placement = false;  ///< nothing but the data says where the organ lies: the ground moves with it
    double load_size = 0;         ///< of unknown loads that were found: they strain tissue by about its square times
                                  ///< `energy`; 0: none
};

struct UpdateResult {
    Deformation deformation;
    Alignment alignment;
    std::vector<Round> rounds;
    LastPulls pulls;
    std::string engine;  ///< description of the device that solved
    double min_jacobian = 1;
    std::optional<ImageFit> image;      ///< where a bare volume was given
    std::optional<SurfaceFit> surface;  ///< where points of a surface were given
    std::optional<PointFit> points;     ///< where pairs of points were given
    std::optional<CurveFit> curves;     ///< where points along vessels were given
    std::optional<ContactFit> contact;  ///< where the model has rigid neighbours
    std::optional<AnchorFit> anchors;   ///< and anchors
    std::vector<StageTime> times;
    bool cut_short = false;           ///< by the time budget: the last round was not reached
    std::vector<std::string> doubts;  ///< reasons not to trust the result, empty when there are none
};

/// Registers one prepared model again and again. What the updates share is made once: the engine that solves, and on a
/// GPU the context, programs and images of the model.
class Updater {
public:
    /// `prepared` outlives this. Throws GpuUnavailable when a GPU was demanded and there is none.
    explicit Updater(const PreparedModel& prepared, const UpdateOptions& options = {},
                     Observer& observer = silent_observer());
    /// The same with an engine of the caller's, made of `prepared.rest`.
    Updater(const PreparedModel& prepared, const UpdateOptions& options, std::unique_ptr<tled::Engine> solver,
            Observer& observer = silent_observer());
    ~Updater();
    Updater(Updater&&) noexcept;
    Updater& operator=(Updater&&) noexcept;

    /// Registers the model to what was seen during the operation. Throws InvalidInput when there is nothing to register
    /// to, a bare volume without prepare_image, label maps that share no label or do not meet, surface points, pairs
    /// of points or curves that cannot be used or lie nowhere near the model; SolverFailure when no trustworthy
    /// equilibrium is found, GpuUnavailable when a device fails that was demanded. Where it was not, the processor does
    /// the update from its beginning and all later ones, with a note.
    UpdateResult update(const Intraoperative& seen, Observer& observer = silent_observer());

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// One update: Updater(prepared, options).update(seen).
UpdateResult update(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options = {},
                    Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
