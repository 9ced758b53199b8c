#pragma once
/// Before the operation: the patient's model, from a label map.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/mesher.hpp"
#include "registration/boundary/interfaces.hpp"
#include "registration/options.hpp"
#include "registration/stage_time.hpp"
#include "tled/model.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <array>
#include <memory>
#include <optional>
#include <vector>

namespace tissuewarp::registration {

/// Edge (mm) of a cube of the labelled voxels' volume.
double organ_size(const imaging::Volume& labels);

/// Edges of the mesh, per edge of a cube of the organ's volume.
struct EdgeOptions {
    /// With labels of the operation, into about 50 000 tetrahedra. 8 mm in place of 6 cost the brain shift accuracy
    /// (docs/lab/results.md, "What it says"); the random phantoms 5001–5008 need no more than 6
    /// (docs/lab/accuracy-time.md).
    double with_labels = 18;
    /// Without, into about 15 000. Chosen on images of the brain shift, both sags and the lung and on surfaces of the
    /// brain shift and the liver (docs/lab/results.md, "How fine a mesh").
    double without_labels = 12;
};

/// Where a mesh's own boundary is looked for in the labels it was made of. Chosen by hand; on which data is not
/// recorded.
struct OffsetOptions {
    double range_mm = 4.0, max_angle_deg = 60.0;  ///< along the normal either way; between normals
};

/// Edge length (mm) that cuts an organ of the map's volume into about 50 000 tetrahedra: organ_size over 18. Boundaries
/// of a label map pull at every node of the surface, which should lie on it.
double suggested_edge_length(const imaging::Volume& labels);

/// The same into about 15 000, over 12: where an image or points pull, without labels. Finer tetrahedra cost three to
/// ten times the seconds and are no more accurate (docs/lab/results.md, "How fine a mesh").
double suggested_edge_length_without_labels(const imaging::Volume& labels);

/// Edge length 0: that of suggested_edge_length. A function, because GCC 12 warns of uninitialised members where a
/// designated initialiser stands in its place.
inline meshing::MeshingOptions automatic_edge_length() {
    meshing::MeshingOptions options;
    options.edge_length = 0;
    return options;
}

/// How stiff surfaces that slide on one another are against overlapping and opening. Chosen by hand: pressures within
/// soft tissue, some 0.1 kPa, open them by a hundredth of a millimetre.
struct SlidingOptions {
    double kpa_per_mm = 10;
};

struct PrepareOptions {
    meshing::MeshingOptions meshing = automatic_edge_length();
    tled::MaterialTable materials;  ///< labels without an entry take `default_material`
    tled::Material default_material = tled::neo_hookean_lnj(3.0, 0.45);  ///< soft tissue: Young's modulus kPa (only its
                                                                         ///< ratios tell), Poisson's ratio. The made
                                                                         ///< phantoms have 0.45 to 0.47 themselves
    std::optional<tled::Element> element;                                ///< default: tled::suggested_element
    /// kPa/mm along the normal per interface area, at full weight: in units of the prior a deviation of 0.38 mm over 1
    /// cm², near a voxel's. Chosen by hand with the first interface; a third and an eighth are worse on the lung's
    /// and the brain sag's masks (docs/decisions/label_weights.md).
    double data_stiffness = 3.0;
    double tangential_ratio = 0.02;     ///< stiffness along the surface over that along the normal. Chosen by hand; on
                                        ///< which data is not recorded
    std::vector<int> anchors;           ///< labels of tissue that stays where the rigid placement has it
    std::vector<int> rigid_neighbours;  ///< labels of bodies that move with the placement and are not meshed; the
                                        ///< organ slides along them and comes off, but does not enter them
    std::vector<std::array<int, 2>> sliding;  ///< pairs of labels whose tissue slides on one another along the surface
                                              ///< that they share
    std::vector<int> resected;  ///< labels of tissue that is gone by the time of the operation: not meshed, not matched
};

/// Throws InvalidInput, naming the label and those present, unless the map holds every anchor, rigid neighbour,
/// resected and sliding label, none of the first three is two of these or 0, something else is left to register, and
/// what slides are two labels of that.
void require_surroundings(const imaging::Volume& moving_labels, const PrepareOptions& options);

/// What the preoperative image shows of the tissue, to be found again in a bare intraoperative volume.
struct ImageModel;

/// Bone and the like about the organ, on the grid of the preoperative label map.
struct RigidNeighbours {
    imaging::Volume labels;    ///< theirs alone
    imaging::Volume distance;  ///< mm to the nearest of them, negative within; float32
};

/// Everything that does not depend on intraoperative data.
struct PreparedModel {
    tled::Model model;       ///< mesh in LPS mm of the preoperative image
    imaging::Volume labels;  ///< the preoperative label map it came from, without rigid neighbours and what is gone
    PrepareOptions options;
    Interfaces interfaces;
    tled::RestState rest;
    tled::RestStiffness stiffness;  ///< K₀ with all interface springs at full weight
    std::vector<StageTime> times;
    std::shared_ptr<const ImageModel> image;  ///< see prepare_image; null without
    std::optional<RigidNeighbours> neighbours;
    std::unique_ptr<PreparedModel> coarse;                     ///< of the same organ, see prepare_loads
    std::vector<std::shared_ptr<const ImageModel>> contrasts;  ///< see prepare_contrast
    imaging::Volume resected = {};                ///< labels of what is gone alone; empty where nothing is
    std::vector<tled::SlidingPair> sliding = {};  ///< of the mesh, which is open where tissue slides
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
/// in and near the labels, without what is gone. Throws InvalidInput, Cancelled.
void prepare_image(PreparedModel& prepared, const imaging::Volume& moving, const ImageModelOptions& options = {},
                   Observer& observer = silent_observer());

/// Adds a further image of the tissue, of another contrast, in the frame of the first. Throws InvalidInput where the
/// model holds no image yet; as prepare_image.
void prepare_contrast(PreparedModel& prepared, const imaging::Volume& moving, const ImageModelOptions& options = {},
                      Observer& observer = silent_observer());

/// Adds what updates take that look for loads which nobody stated, from labels alone or from points of a free organ: of
/// a model of more than 6000 nodes a coarser one, with edges of suggested_edge_length_without_labels, on which they are
/// found. Without it the first such update makes one, in seconds. Adds nothing to a smaller model, nor to one that
/// anchors or rigid neighbours hold, whose loads are not looked for. Throws InvalidInput, Cancelled.
void prepare_loads(PreparedModel& prepared, Observer& observer = silent_observer());

/// prepare() and prepare_loads() in one, with the same bits; both meshes are made at the same time where edges tell
/// that the model will be large. `observer` is asked from two threads whether to stop. Throws InvalidInput, Cancelled.
PreparedModel prepare_for_loads(const imaging::Volume& moving_labels, const PrepareOptions& options = {},
                                Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
