// Before the operation: label map → mesh → rest state → rest stiffness.

#include "registration/prepare.hpp"
#include "core/stopwatch.hpp"
#include "registration/boundary/label_boundary_field.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/springs/label_springs.hpp"
#include "registration/terms/anchors.hpp"

#include "imaging/labels.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/matching/image_mask.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/resection/cavity_wall.hpp"

#include <cmath>

namespace tissuewarp::registration {

namespace {

tled::Model model_of(meshing::TetMesh mesh, const PrepareOptions& options) {
    tled::Model model;
    model.mesh = std::move(mesh);
    model.materials = options.materials;
    for (const int label : model.mesh.labels) model.materials.try_emplace(label, options.default_material);
    model.element = options.element.value_or(tled::suggested_element(model.materials));
    return model;
}

/// Distance along the normal from each interface node to the boundary in the moving labels themselves, so that a
/// registration of an image to itself is the identity. NaN marks faces that are no tissue boundary: cuts by the image's
/// border.
void measure_offsets(Interfaces& interfaces, const meshing::TetMesh& mesh, const LabelBoundaryField& moving) {
    constexpr OffsetOptions options;
    for (InterfaceNode& node : interfaces.nodes())
        node.offset = moving.crossing(mesh.nodes.col(node.node), node.normal, node.inner, node.outer, options.range_mm,
                                      options.max_angle_deg);
}

tled::NodalConditions label_conditions(const Interfaces& interfaces, const PrepareOptions& options, int nodes) {
    tled::Conditions conditions;
    conditions.springs = detail::full_weight_springs(interfaces, options);
    return tled::nodal_conditions(conditions, nodes);
}

/// Numbers of a factor depend on what pulls at the tissue, and relaxation needs none.
void make_ready(const tled::RestStiffness& stiffness) {
    if (!stiffness.is_large()) stiffness.analyse();
    (void)stiffness.approximate_lowest_eigenvalue();
}

/// Precondition: require_surroundings.
PreparedModel of_mesh(meshing::TetMesh mesh, const imaging::Volume& moving_labels, const PrepareOptions& options,
                      Observer& observer) {
    Stopwatch stopwatch;
    std::vector<StageTime> times;
    imaging::Volume organ = imaging::without_labels(moving_labels, detail::not_meshed(options));
    imaging::Volume resected = detail::labels_alone(moving_labels, options.resected);
    std::optional<RigidNeighbours> neighbours = detail::rigid_neighbours(moving_labels, options.rigid_neighbours);
    tled::Model model = model_of(std::move(mesh), options);
    tled::RestState rest = tled::rest_state(model);
    Interfaces interfaces(model.mesh);
    measure_offsets(interfaces, model.mesh, LabelBoundaryField(organ, interfaces.thickness(model.mesh)));
    if (!resected.empty()) detail::mark_cavity_wall(interfaces, model.mesh, resected);
    times.push_back({"rest state", stopwatch.lap()});
    observer.checkpoint("rest stiffness", 0.0);
    const auto springs = label_conditions(interfaces, options, rest.node_count);
    tled::RestStiffness stiffness(rest, springs);
    make_ready(stiffness);
    times.push_back({"rest stiffness", stopwatch.lap()});
    return {std::move(model),
            std::move(organ),
            options,
            std::move(interfaces),
            std::move(rest),
            std::move(stiffness),
            std::move(times),
            nullptr,
            std::move(neighbours),
            nullptr,
            {},
            std::move(resected)};
}

}  // namespace

double organ_size(const imaging::Volume& labels) {
    return std::cbrt(cv::countNonZero(imaging::mask_of_all(labels).voxels.reshape(1, 1)) *
                     labels.geometry.voxel_volume());
}

double suggested_edge_length(const imaging::Volume& labels) {
    return organ_size(labels) / EdgeOptions().with_labels;
}

double suggested_edge_length_without_labels(const imaging::Volume& labels) {
    return organ_size(labels) / EdgeOptions().without_labels;
}

PreparedModel prepare(const imaging::Volume& moving_labels, const PrepareOptions& given, Observer& observer) {
    PrepareOptions options = given;
    require_surroundings(moving_labels, options);
    const imaging::Volume organ = imaging::without_labels(moving_labels, detail::not_meshed(options));
    if (options.meshing.edge_length == 0) options.meshing.edge_length = suggested_edge_length(organ);
    Stopwatch stopwatch;
    meshing::TetMesh mesh = meshing::mesh_labels(organ, options.meshing, observer);
    const StageTime meshing_time{"meshing", stopwatch.lap()};
    PreparedModel prepared = of_mesh(std::move(mesh), moving_labels, options, observer);
    prepared.times.insert(prepared.times.begin(), meshing_time);
    return prepared;
}

PreparedModel prepare(meshing::TetMesh mesh, const imaging::Volume& moving_labels, const PrepareOptions& options,
                      Observer& observer) {
    require_surroundings(moving_labels, options);
    return of_mesh(std::move(mesh), moving_labels, options, observer);
}

PreparedModel with_materials(PreparedModel prepared, const tled::MaterialTable& materials) {
    prepared.model.materials = prepared.options.materials = materials;
    prepared.rest = tled::rest_state(prepared.model);
    prepared.stiffness = tled::RestStiffness(
        prepared.rest, label_conditions(prepared.interfaces, prepared.options, prepared.rest.node_count));
    make_ready(prepared.stiffness);
    if (prepared.coarse) *prepared.coarse = with_materials(std::move(*prepared.coarse), materials);
    return prepared;
}

namespace {

std::shared_ptr<const ImageModel> image_model(PreparedModel& prepared, const imaging::Volume& given,
                                              const ImageModelOptions& options, Observer& observer) {
    Stopwatch stopwatch;
    const imaging::Volume moving =
        prepared.resected.empty() ? given : without_unmatched(given, detail::all_but(prepared.resected));
    observer.checkpoint("feature points", 0.0);
    const FeaturePoints features =
        select_feature_points(moving, imaging::mask_of_all(prepared.labels), options.features);
    auto result = std::make_shared<const ImageModel>(
        ImageModel{moving, MatchingTemplate(moving, features.points, options.blocks)});
    prepared.times.push_back({"feature points", stopwatch.lap()});
    return result;
}

}  // namespace

void prepare_image(PreparedModel& prepared, const imaging::Volume& moving, const ImageModelOptions& options,
                   Observer& observer) {
    prepared.image = image_model(prepared, moving, options, observer);
}

void prepare_contrast(PreparedModel& prepared, const imaging::Volume& moving, const ImageModelOptions& options,
                      Observer& observer) {
    if (!prepared.image) throw InvalidInput("the model holds no image for a contrast to belong to; call prepare_image");
    prepared.contrasts.push_back(image_model(prepared, moving, options, observer));
}

void prepare_loads(PreparedModel& prepared, Observer& observer) {
    if (!detail::loads_take_coarse_model(prepared) || detail::is_held(prepared)) return;
    Stopwatch stopwatch;
    observer.checkpoint("coarse model", 0.0);
    prepared.coarse = std::make_unique<PreparedModel>(detail::coarse_model_for_loads(prepared, observer));
    prepared.times.push_back({"coarse model", stopwatch.lap()});
}

}  // namespace tissuewarp::registration
