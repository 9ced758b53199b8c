#include "registration/resection/find_resection.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/doubts.hpp"
#include "registration/field.hpp"
#include "registration/resection/cavity_wall.hpp"
#include "registration/resection/without_counterpart.hpp"
#include "registration/resection/without_structure.hpp"
#include "registration/warp.hpp"

#include <Eigen/LU>

#include <cstdint>
#include <vector>

namespace tissuewarp::registration {

namespace {

using detail::CavityView;
using Eigen::Vector3d;
using imaging::millilitres;
using imaging::Volume;

/// What of the images a cavity is told by, on one grid.
struct Look {
    CavityView fixed, moving;

    Look(const PreparedModel& whole, const Volume& moving_image, const Volume& fixed_image, const Volume& field)
        : Look(imaging::mask_of_all(warp_labels(whole.labels, field)), moving_image, fixed_image, field) {}

private:
    Look(const Volume& organ, const Volume& moving_image, const Volume& fixed_image, const Volume& field)
        : fixed(fixed_image, organ, organ), moving(warp_image(moving_image.as(CV_32F), field), organ, organ) {}
};

/// Of a tetrahedron, mm³.
double volume_of(const Eigen::Matrix<double, 3, 4>& corners) {
    const Eigen::Matrix3d edges = corners.rightCols<3>().colwise() - corners.col(0);
    return edges.determinant() / 6;
}

/// Labelled voxels that a forward field leads into the cavity.
Volume led_into(const Volume& cavity, const Volume& labels, const Deformation& deformation) {
    const Volume field = displacement_moving_to_fixed(deformation, labels.geometry);
    const Volume numbers = cavity.as(CV_32S);
    const Volume map = labels.as(CV_32S);
    Volume gone(labels.geometry, CV_8UC1);
    const auto& size = labels.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                const std::int64_t n = labels.offset(i, j, k);
                if (map.data<std::int32_t>()[n] == 0) continue;
                const cv::Vec3f& u = field.data<cv::Vec3f>()[n];
                const Vector3d y = labels.geometry.point(Vector3d(i, j, k)) + Vector3d(u[0], u[1], u[2]);
                gone.data<std::uint8_t>()[n] = detail::label_at(numbers, y) != 0;
            }
    return gone;
}

/// Of the voxels of a mask.
Volume near_the_outside(const Volume& mask, const Volume& labels) {
    Volume near = mask.clone();
    near.voxels.setTo(0, imaging::erode(imaging::mask_of_all(labels), cavity_options.surface_mm).voxels);
    return near;
}

/// Volume that tissue near a mask (uint8, moving frame) lost where it was squeezed, ml. Tissue keeps its volume: what
/// has no room was not there.
double squeezed_ml(const Deformation& deformation, const Volume& gone) {
    const Volume near = imaging::dilate(gone, cavity_options.squeezed_mm).as(CV_32S);
    const meshing::TetMesh& mesh = deformation.mesh;
    double lost = 0;
    for (const auto& tet : mesh.tets.colwise()) {
        const Eigen::Matrix<double, 3, 4> rest = mesh.nodes(Eigen::all, tet),
                                          deformed = rest + deformation.displacement(Eigen::all, tet);
        if (detail::label_at(near, rest.rowwise().mean()) == 0) continue;
        const double before = volume_of(rest), after = volume_of(deformed);
        if (after < cavity_options.squeezed * before) lost += before - after;
    }
    return lost / 1000;
}

}  // namespace

ImageModelOptions image_of_first_look() {
    ImageModelOptions options;
    options.features.count = FirstLook().features;
    return options;
}

UpdateOptions for_first_look(UpdateOptions options) {
    options.image.dense_coarsening = FirstLook().dense_coarsening;
    options.rematches = std::min(options.rematches, FirstLook().rounds);
    return options;
}

FoundResection find_resection(const PreparedModel& whole, const Deformation& deformation, const Volume& moving,
                              const Volume& fixed, Observer& observer) {
    constexpr double margin_mm = 10;
    const Volume field = displacement_fixed_to_moving(
        deformation, detail::grid_about(fixed.geometry, deformation.deformed_nodes(), margin_mm), {}, observer);
    const Look look(whole, moving, fixed, field);
    observer.checkpoint("resection", 0.5);
    FoundResection found;
    Volume cavity(look.fixed.organ.geometry, CV_8UC1);
    const std::vector<Volume> cores =
        detail::pieces_of(detail::without_counterpart(look.fixed, look.moving), cavity_options.least_core_ml);
    for (const Volume& core : cores) cavity.voxels |= detail::up_to_wall(look.fixed, core).voxels;
    if (!cores.empty() && look.fixed.tissue_deviation > 0)
        found.deviation =
            detail::median(detail::values_in(look.fixed.deviation, cores.front())) / look.fixed.tissue_deviation;
    found.gone = led_into(cavity, whole.labels, deformation);
    if (millilitres(found.gone) < cavity_options.least_ml) {
        found.gone.voxels.setTo(0);
        cavity.voxels.setTo(0);
    }
    found.gone_ml = millilitres(found.gone);
    found.cavity_ml = millilitres(cavity);
    found.at_surface_ml = millilitres(near_the_outside(found.gone, whole.labels));
    found.cavity = imaging::resample(cavity, fixed.geometry, imaging::Interpolation::Nearest);
    return found;
}

std::vector<Doubt> doubts_of(const FoundResection& found, const Deformation& deformation, const Volume& gap) {
    constexpr double least_agreement = 0.7;
    constexpr const char* remedy = "draw what is gone in the moving labels, and name its label by --resected";
    std::vector<Doubt> doubts;
    if (found.gone_ml == 0) {
        doubts.push_back({"resected.not_found", 0, cavity_options.least_ml,
                          "no cavity was found in the fixed image that tissue without a counterpart lies at: all of it "
                          "is taken to be there",
                          remedy});
        return doubts;
    }
    const double at_surface = found.at_surface_ml / found.gone_ml;
    if (at_surface > cavity_options.most_at_surface)
        doubts.push_back({"resected.unclear", at_surface, cavity_options.most_at_surface,
                          detail::percent(at_surface) +
                              " of the tissue that is taken for gone lies at the organ's outer surface, where it may "
                              "have sunk instead",
                          remedy});
    const double squeezed = squeezed_ml(deformation, found.gone),
                 most_squeezed = cavity_options.most_squeezed * found.gone_ml;
    if (squeezed > most_squeezed)
        doubts.push_back({"resected.unclear", squeezed, most_squeezed,
                          "tissue about the hole is squeezed by " + detail::to_text(squeezed) +
                              " ml: more is gone than lies in the cavity, which collapsed",
                          remedy});
    const Volume hole = imaging::mask_of_all(gap);
    Volume both = hole;
    both.voxels = hole.voxels & found.cavity.voxels;
    const double agreement = 2 * millilitres(both) / (millilitres(hole) + millilitres(found.cavity));
    if (agreement < least_agreement)
        doubts.push_back({"resected.unclear", agreement, least_agreement,
                          "the hole that the model leaves and the cavity that was found in the image overlap by a Dice "
                          "of " +
                              detail::to_text(agreement) + " only",
                          remedy});
    return doubts;
}

}  // namespace tissuewarp::registration
