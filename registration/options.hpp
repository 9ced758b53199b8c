#pragma once
/// What an update may be told. Each default says what it was chosen on; those that say nothing were chosen by hand, on
/// which data is not recorded (docs/decisions/constants.md). Numbers that a user does not choose stand beside the code
/// that uses them.

#include "tled/equilibrium.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::registration {

struct FeatureOptions {
    int count = 5000;              ///< most points returned; fewer when the organ is too small to spread them
    double margin_mm = 2.0;        ///< points up to this far outside the mask: the organ's own surface is an edge
    double grid_spacing_mm = 1.0;  ///< structure is looked at on a grid of at most this spacing
    double gradient_mm = 1.0;      ///< standard deviation of the smoothing before the gradient
    double window_mm = 2.0;        ///< standard deviation of the window over gradient products
};

/// What of the moving image is compared, and on which grids: MIND-SSC descriptors (Heinrich et al., MICCAI 2013), alike
/// in any pair of modalities.
struct TemplateOptions {
    double grid_spacing_mm = 1.0;  ///< isotropic working grid of the last level; every level before doubles it
    int levels = 3;                ///< 4, 2, 1 mm
    int block_radius = 4;          ///< voxels of the level's grid: blocks of 36, 18 and 9 mm
};

struct ImageModelOptions {
    FeatureOptions features;
    TemplateOptions blocks;
};

/// How a model is placed rigidly.
struct AlignmentOptions {
    double trim_mm = 8.0;           ///< distances beyond this count as this much: what deformed does not drag the pose
    double start_angle_deg = 30.0;  ///< the search starts from rotations of up to this angle about each axis
    int samples = 6000;             ///< boundary points used, half from each image
};

/// Which points are searched on the finest grid: all; or those alone that lie too near the border of what the moving
/// image shows to be described, where dense searches are to follow, which say nothing there.
enum class FinestGrid { AllPoints, UndescribedPoints };

struct BlockMatchingOptions {
    int skipped_levels = 0;  ///< coarse levels left out: a prediction good to a few mm needs none of them
    FinestGrid finest = FinestGrid::AllPoints;
    double search_mm = 16.0;    ///< range of the first level about the predicted position, along each axis
    double least_share = 0.05;  ///< share of a block that both images must show. Chosen on the stripped heads, of whose
                                ///< rim a third lost three points in ten (docs/lab/results.md, "Block matching")
    double back_match_voxels = 1;  ///< standard deviation of the back-match error in the confidence
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< moving → fixed, that the predicted positions contain
};

struct ConsistencyOptions {
    int neighbours = 24;             ///< matches around each that must tell the same story
    double trimmed_share = 0.4;      ///< of the neighbours, left out of each fit
    double least_confidence = 0.15;  ///< matches below it are dropped, and vouch for none
    double most_residual_mm = 2.0;   ///< matches further from their neighbours' story are outliers; so are those
                                     ///< whose neighbours are that far from any story (median)
};

enum class Device { Auto, Cpu, Gpu };

/// How two images are compared. Auto: by LinearCombination where the fixed one is ultrasound.
enum class Similarity {
    Auto,
    SelfSimilarity,    ///< of any contrasts (MIND-SSC)
    LinearCombination  ///< of ultrasound and an image of another kind (LC2; Wein et al., MICCAI 2013)
};

/// How blocks of a bare volume are searched and weighed (docs/method.md, section 8).
struct ImageOptions {
    Similarity similarity = Similarity::Auto;
    BlockMatchingOptions matching;
    ConsistencyOptions consistency;
    /// After the search for blocks, dense searches on grids so many times doubled from the blocks' finest. Templates of
    /// grey values have none. Chosen among some 35 settings on brain shift, both brain sags and lung
    /// (docs/lab/results.md).
    std::vector<int> dense_coarsening{1, 1, 0};
    double expected_motion_mm = 100;  ///< of the organ's surface in the field of view of the intraoperative image: free
    double unseen_motion_mm = 0.8;    ///< and out of it, along its normal: what is around holds it there, …
    double unseen_slide_mm = 4;  ///< … and lets it slide along itself. Both chosen on the degraded brain shift, with
                                 ///< the degraded sag beside it
    double headers_within_mm = 15;  ///< the headers place an organ, part of which is out of view, closer than this. The
                                    ///< rule was found on the degraded sag
};

/// What is expected of tissue before anything is seen. It weighs strain energy against matches and points, and holds
/// what no datum shows.
struct TissuePrior {
    /// Deviation of the strain of pieces of tissue. Chosen between what the clean and the degraded brain sag like best,
    /// with the brain shift beside them (docs/lab/results.md, "Stiffer or softer").
    double expected_strain = 0.12;
    double strain_length_mm = 10;  ///< size of these pieces
    double free_motion_mm = 20;    ///< of the organ's surface, from where the organ lies as a whole; not chosen on the
                                   ///< liver's surface, where 40 and 80 do as well
    double held_motion_mm = 5;  ///< the same where the images are in one frame: what is around holds the organ. Chosen
                                ///< on the brain shift's surface
    /// Of unknown loads that move what points do not show, where the placement is free; 0: none, and no unknown weight
    /// where labels are seen. Chosen on the liver's surface, where more change nothing
    /// (docs/decisions/unknown_loads.md).
    int load_shapes = 48;
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

}  // namespace tissuewarp::registration
