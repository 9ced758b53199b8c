#include "apps/register_products.hpp"

#include "apps/output_names.hpp"
#include "imaging/labels.hpp"
#include "registration/field.hpp"
#include "registration/field/parted.hpp"
#include "registration/resection/gap.hpp"
#include "registration/surroundings/rigid_surroundings.hpp"
#include "registration/warp.hpp"

#include <fmt/format.h>

#include <limits>

namespace tissuewarp::apps {

using namespace registration;

namespace {

/// Coordinates that are not a number where the tissue of a point is gone.
void mark_gone(const RegistrationRun& run, const Eigen::Matrix3Xd& places, Eigen::Matrix3Xd& carried) {
    const std::vector<bool> gone = points_gone(run.result.deformation, run.prepared->resected, places);
    for (Eigen::Index p = 0; p < carried.cols(); ++p)
        if (gone[static_cast<std::size_t>(p)]) carried.col(p).setConstant(std::numeric_limits<double>::quiet_NaN());
}

void note_points_gone(const Eigen::Matrix3Xd& carried, const char* what, ProgressLine& progress) {
    const Eigen::Index left = carried.array().isFinite().colwise().all().count();
    if (left == carried.cols()) return;
    progress.note(fmt::format("{} of {} {} lay in resected tissue: they have no place and are not scored",
                              carried.cols() - left, carried.cols(), what));
}

/// Where no fixed image gives a grid: the moving one, carried along by the rigid alignment.
imaging::Geometry output_grid(const RegistrationRun& run) {
    if (const imaging::Geometry* fixed = run.inputs.fixed_grid()) return *fixed;
    const Eigen::Isometry3d& placement = run.result.deformation.placement;
    imaging::Geometry grid = run.inputs.moving_grid();
    grid.origin = placement * grid.origin;
    grid.direction = placement.linear() * grid.direction;
    return grid;
}

}  // namespace

void make_backward_field(RegistrationRun& run, ProgressLine& progress) {
    progress.begin("field", 0.47, 0.55);
    const FieldOptions options{run.options.fade};
    Deformation& deformation = run.result.deformation;
    if (!run.inputs.moving.empty() && !run.inputs.fixed.empty())
        deformation.surroundings =
            rigid_surroundings(deformation, run.inputs.moving, run.inputs.fixed, options, progress);
    run.products.fixed_to_moving = displacement_fixed_to_moving(deformation, output_grid(run), options, progress);
    run.products.unfolded_back = unfold_fixed_to_moving(run.products.fixed_to_moving, deformation);
}

void make_forward_field(RegistrationRun& run, ProgressLine& progress) {
    run.products.moving_to_fixed = displacement_moving_to_fixed(run.result.deformation, run.inputs.moving_grid(),
                                                                FieldOptions{run.options.fade}, progress);
    run.products.unfolded_forth = unfold_moving_to_fixed(run.products.moving_to_fixed, run.result.deformation);
}

void warp_everything(RegistrationRun& run) {
    const RegistrationInputs& inputs = run.inputs;
    Products& products = run.products;
    if (!inputs.moving.empty()) products.warped = warp_image(inputs.moving, products.fixed_to_moving);
    products.warped_labels = warp_labels(inputs.moving_labels, products.fixed_to_moving);
    if (!inputs.landmarks && !inputs.points && !inputs.surface) return;
    const PointTransform transform(run.result.deformation, {run.options.fade});
    if (inputs.landmarks) products.landmarks = transform(inputs.landmarks->moving);
    if (inputs.points) products.points = transform(*inputs.points);
    if (inputs.surface) {
        products.surface = inputs.surface;
        products.surface->nodes = transform(products.surface->nodes);
    }
}

void leave_out_what_is_gone(RegistrationRun& run, ProgressLine& progress) {
    const imaging::Volume& resected = run.prepared->resected;
    Products& products = run.products;
    if (run.options.find_resected) products.gap = imaging::Volume(products.fixed_to_moving.geometry, CV_8UC1);
    if (resected.empty()) return;
    products.gap = gap_after(run.result.deformation, resected, products.fixed_to_moving);
    if (!products.warped.empty()) leave_gap(products.warped, products.gap, gap_value);
    leave_gap(products.warped_labels, products.gap);
    if (run.inputs.landmarks) mark_gone(run, run.inputs.landmarks->moving, products.landmarks);
    if (run.inputs.points) mark_gone(run, *run.inputs.points, products.points);
    note_points_gone(products.landmarks, "landmarks", progress);
    note_points_gone(products.points, "points", progress);
}

void find_parted(RegistrationRun& run) {
    Products& products = run.products;
    if (!writes_gap(run.options)) return;
    products.parted = parted_after(run.result.deformation, products.fixed_to_moving);
    if (!products.gap.empty()) products.parted.voxels.setTo(0, products.gap.voxels);
}

void note_parted(const RegistrationRun& run, ProgressLine& progress) {
    constexpr double least_ml = 0.1;
    const double ml = imaging::millilitres(run.products.parted);
    if (ml < least_ml) return;
    progress.note(
        fmt::format("tissue parted: {:.1f} ml of what was warped show what lay there before stretched to more "
                    "than twice its volume ({} is 2 there)",
                    ml, gap_name));
}

}  // namespace tissuewarp::apps
