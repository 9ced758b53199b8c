// Before the operation: label map → mesh → rest state → rest stiffness.

#include "registration/prepare.hpp"
#include "core/kept_notes.hpp"
#include "core/stopwatch.hpp"
#include "registration/boundary/label_boundary_field.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/springs/conditions.hpp"
#include "registration/springs/label_springs.hpp"
#include "registration/terms/anchors.hpp"

#include "imaging/labels.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/matching/image_mask.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/resection/cavity_wall.hpp"
#include "tled/tissue_mesh.hpp"

#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <cmath>
#include <exception>
#include <memory>
#include <utility>

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

tled::Conditions label_conditions(const Interfaces& interfaces, const PrepareOptions& options) {
    tled::Conditions conditions;
    conditions.springs = detail::full_weight_springs(interfaces, options);
    return conditions;
}

/// Opens a mesh where tissue is to slide; one that was opened so before is left as it is.
std::vector<tled::SlidingPair> open_where_tissue_slides(meshing::TetMesh& mesh, const PrepareOptions& options) {
    if (options.sliding.empty()) return {};
    tled::TissueMesh tissue = tled::closed(tled::rejoined(mesh));
    std::vector<tled::SlidingPair> pairs;
    for (const std::array<int, 2>& labels : options.sliding) {
        const auto more =
            tled::open_interface(tissue, tled::sides_of_labels(tissue, labels), {}, SlidingOptions().kpa_per_mm);
        pairs.insert(pairs.end(), more.begin(), more.end());
    }
    mesh = std::move(tissue.mesh);
    return pairs;
}

/// Numbers of a factor depend on what pulls at the tissue, and relaxation needs none.
void make_ready(const tled::RestStiffness& stiffness) {
    if (!stiffness.is_large()) stiffness.analyse();
    (void)stiffness.approximate_lowest_eigenvalue();
    (void)stiffness.approximate_highest_eigenvalue();
}

/// Precondition: require_surroundings.
PreparedModel of_mesh(meshing::TetMesh mesh, const imaging::Volume& moving_labels, const PrepareOptions& options,
                      Observer& observer) {
    Stopwatch stopwatch;
    std::vector<StageTime> times;
    imaging::Volume organ = imaging::without_labels(moving_labels, detail::not_meshed(options));
    imaging::Volume resected = detail::labels_alone(moving_labels, options.resected);
    std::optional<RigidNeighbours> neighbours = detail::rigid_neighbours(moving_labels, options.rigid_neighbours);
    std::vector<tled::SlidingPair> sliding = open_where_tissue_slides(mesh, options);
    tled::Model model = model_of(std::move(mesh), options);
    tled::RestState rest = tled::rest_state(model);
    Interfaces interfaces(model.mesh, sliding);
    measure_offsets(interfaces, model.mesh, LabelBoundaryField(organ, interfaces.thickness(model.mesh)));
    if (!resected.empty()) detail::mark_cavity_wall(interfaces, model.mesh, resected);
    times.push_back({"rest state", stopwatch.lap()});
    observer.checkpoint("rest stiffness", 0.0);
    tled::Conditions conditions = label_conditions(interfaces, options);
    conditions.effects.sliding = sliding;
    tled::RestStiffness stiffness(rest, tled::nodal_conditions(conditions, rest));
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
            std::move(resected),
            std::move(sliding)};
}

PrepareOptions with_edge_length(PrepareOptions options, const imaging::Volume& organ) {
    if (options.meshing.edge_length == 0) options.meshing.edge_length = suggested_edge_length(organ);
    return options;
}

/// A model that is made on another thread, and may turn out not to be needed.
class ModelBeside {
public:
    explicit ModelBeside(Observer& observer) : notes_(observer) {}
    /// To its end: where tasks are cancelled their loops end half done, and what follows reads what is not there.
    ~ModelBeside() { task_.wait(); }
    ModelBeside(const ModelBeside&) = delete;
    ModelBeside& operator=(const ModelBeside&) = delete;

    void start(const imaging::Volume& labels, const PrepareOptions& options) {
        started_ = true;
        task_.run([this, labels, options] {
            try {
                made_ = std::make_unique<PreparedModel>(prepare(labels, options, notes_));
            } catch (...) {
                failure_ = std::current_exception();
            }
        });
    }
    [[nodiscard]] bool started() const { return started_; }
    /// Throws what making it threw.
    std::unique_ptr<PreparedModel> take(Observer& observer) {
        task_.wait();
        if (failure_) std::rethrow_exception(failure_);
        notes_.tell(observer);
        return std::move(made_);
    }

private:
    KeptNotes notes_;
    std::unique_ptr<PreparedModel> made_;
    std::exception_ptr failure_;
    bool started_ = false;
    tbb::task_group task_;
};

bool takes_coarse_model(const PreparedModel& prepared) {
    return detail::loads_take_coarse_model(prepared) && !detail::is_held(prepared);
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
    require_surroundings(moving_labels, given);
    const imaging::Volume organ = imaging::without_labels(moving_labels, detail::not_meshed(given));
    const PrepareOptions options = with_edge_length(given, organ);
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
        prepared.rest, detail::conditions_on(prepared, label_conditions(prepared.interfaces, prepared.options)));
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
    if (!takes_coarse_model(prepared)) return;
    Stopwatch stopwatch;
    observer.checkpoint("coarse model", 0.0);
    prepared.coarse = std::make_unique<PreparedModel>(detail::coarse_model_for_loads(prepared, observer));
    prepared.times.push_back({"coarse model", stopwatch.lap()});
}

PreparedModel prepare_for_loads(const imaging::Volume& moving_labels, const PrepareOptions& given, Observer& observer) {
    require_surroundings(moving_labels, given);
    const imaging::Volume organ = imaging::without_labels(moving_labels, detail::not_meshed(given));
    const PrepareOptions options = with_edge_length(given, organ);
    ModelBeside coarse(observer);
    if (detail::loads_will_take_coarse_model(organ, options))
        coarse.start(organ, detail::coarse_options_for_loads(organ, options));
    // Isolated, so that waiting for parts of this one does not begin the other.
    PreparedModel prepared = tbb::this_task_arena::isolate([&] { return prepare(moving_labels, options, observer); });
    if (!coarse.started()) {
        prepare_loads(prepared, observer);
    } else if (takes_coarse_model(prepared)) {
        Stopwatch stopwatch;
        prepared.coarse = coarse.take(observer);
        prepared.times.push_back({"coarse model", stopwatch.lap()});
    }
    return prepared;
}

}  // namespace tissuewarp::registration
