#include "registration/terms/terms.hpp"

#include "imaging/labels.hpp"
#include "registration/terms/anchors.hpp"
#include "registration/terms/ground.hpp"

namespace tissuewarp::registration::detail {

namespace {

void require_common_labels(const PreparedModel& prepared, const imaging::Volume& fixed_labels) {
    for (const int label : imaging::labels_in(fixed_labels.as(CV_32S)))
        if (prepared.model.materials.contains(label)) return;
    throw InvalidInput("the fixed label map holds none of the labels of the model; check the label tables");
}

}  // namespace

void require_usable(const PreparedModel& prepared, const Intraoperative& seen) {
    if (!seen.labels && !seen.image && !seen.surface && !seen.points && !seen.curves)
        throw InvalidInput(
            "nothing to register to; give labels, an image, points of a surface, pairs of points or curves");
    if (seen.image && !prepared.image)
        throw InvalidInput("a bare volume was given, but the model holds no preoperative image; call prepare_image");
    if (seen.labels) require_common_labels(prepared, *seen.labels);
}

EvidenceSet::EvidenceSet(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                         std::optional<ImageTools>& image_tools)
    : energy(strain_energy_unit(prepared, options.tissue)) {
    const TissuePrior& tissue = options.tissue;
    if (seen.image) image.emplace(prepared, *seen.image, options.image, *image_tools, energy);
    if (seen.surface) surface.emplace(prepared, *seen.surface, options.surface, energy);
    if (seen.points) points.emplace(prepared, *seen.points, options.points, energy);
    if (seen.curves) curves.emplace(prepared, *seen.curves, options.curves, energy);
    if (!seen.labels && !seen.image)
        ground = ground_springs(prepared, energy, [&](const InterfaceNode&) {
            return options.align ? tissue.free_motion_mm : tissue.held_motion_mm;
        });
    if (prepared.neighbours) contact.emplace(prepared, energy);
    anchors = anchor_springs(prepared, energy);
    placed = is_held(prepared);
}

Contribution EvidenceSet::contribution(const RoundPlan& plan, const State& state) {
    Contribution sum;
    if (labels) add(sum, labels->contribution(plan, state));
    if (image) add(sum, image->contribution(plan, state));
    if (surface) add(sum, surface->contribution(plan, state));
    if (points) add(sum, points->contribution(plan, state));
    if (curves) add(sum, curves->contribution(plan, state));
    return sum;
}

std::vector<tled::Spring> EvidenceSet::supports(const RoundPlan& plan, const State& state) const {
    std::vector<tled::Spring> springs = anchors;
    if (!contact) return springs;
    const Contribution touching = contact->contribution(plan, state);
    springs.insert(springs.end(), touching.conditions.springs.begin(), touching.conditions.springs.end());
    return springs;
}

void EvidenceSet::judge(const State& state, UpdateResult& result) {
    if (image) result.image = image->fit(state);
    if (surface) result.surface = surface->fit(state);
    if (points) result.points = points->fit(state);
    if (curves) result.curves = curves->fit(state);
    if (contact) result.contact = contact->fit(state);
}

Alignment align(const PreparedModel& prepared, const Intraoperative& seen, EvidenceSet& evidence,
                const UpdateOptions& options, Observer& observer) {
    if (seen.labels) return align_labels(prepared.labels, *seen.labels, options.alignment, observer);
    if (evidence.points && evidence.points->show_rotation()) return evidence.points->align();
    if (evidence.surface) return evidence.surface->align(options.alignment, observer);
    if (evidence.curves)
        return evidence.curves->align(evidence.points ? evidence.points->align().placement
                                                      : Eigen::Isometry3d::Identity());
    if (evidence.points) return evidence.points->align();
    const State start{Eigen::Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, prepared.rest.node_count)};
    evidence.image->search(start, observer);
    return {evidence.image->rigid_motion(), 0};
}

}  // namespace tissuewarp::registration::detail
