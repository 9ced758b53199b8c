#include "apps/model_making.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "meshing/quality.hpp"
#include "registration/tissues.hpp"

namespace tissuewarp::apps {

using namespace registration;

double chosen_edge_length(const PreoperativeOptions& options, const RegistrationInputs& inputs, bool for_labels) {
    if (inputs.moving_mesh) return meshing::quality(*inputs.moving_mesh).edge_mm.median;
    if (options.edge_length > 0) return options.edge_length;
    const imaging::Volume organ = organ_of(inputs.moving_labels, options);
    return for_labels ? suggested_edge_length(organ) : suggested_edge_length_without_labels(organ);
}

namespace {

PrepareOptions prepare_options(const PreoperativeOptions& options, const RegistrationInputs& inputs,
                               double edge_length_mm) {
    PrepareOptions made;
    made.meshing.edge_length = edge_length_mm;
    made.meshing.label_edge_length = options.label_edge_length;
    for (const auto& [label, tissue] : inputs.materials) made.materials[label] = material_of(tissue);
    made.default_material = options.tissue == tissues().front().name
                                ? tled::neo_hookean_lnj(options.default_youngs_modulus, options.default_poissons_ratio)
                                : tissue_named(options.tissue).material;
    if (options.element == "t4") made.element = tled::Element::T4;
    if (options.element == "averaged-pressure") made.element = tled::Element::AveragedPressureT4;
    made.data_stiffness = options.data_stiffness;
    made.anchors = options.anchors;
    made.rigid_neighbours = options.rigid_neighbours;
    made.resected = options.resected;
    made.sliding = options.sliding;
    return made;
}

}  // namespace

PreparedModel made_model(const PreoperativeOptions& options, const RegistrationInputs& inputs, double edge_length_mm,
                         Observer& observer) {
    const PrepareOptions made = prepare_options(options, inputs, edge_length_mm);
    return inputs.moving_mesh ? prepare(*inputs.moving_mesh, inputs.moving_labels, made, observer)
                              : prepare(inputs.moving_labels, made, observer);
}

PreparedModel made_model_for_loads(const PreoperativeOptions& options, const RegistrationInputs& inputs,
                                   double edge_length_mm, Observer& observer) {
    if (!inputs.moving_mesh)
        return prepare_for_loads(inputs.moving_labels, prepare_options(options, inputs, edge_length_mm), observer);
    PreparedModel model = made_model(options, inputs, edge_length_mm, observer);
    prepare_loads(model, observer);
    return model;
}

void add_images(PreparedModel& model, const RegistrationInputs& inputs, Observer& observer,
                const ImageModelOptions& options) {
    prepare_image(model, inputs.moving_matched, options, observer);
    for (const imaging::Volume& contrast : inputs.moving_contrasts)
        prepare_contrast(model, contrast, options, observer);
}

}  // namespace tissuewarp::apps
