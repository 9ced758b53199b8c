#include "registration/uncertainty/doubts.hpp"

#include "imaging/labels.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tissuewarp::registration::detail {

namespace {

double labelled_volume(const imaging::Volume& labels) {
    return cv::countNonZero(imaging::mask_of_all(labels).voxels.reshape(1, 1)) * labels.geometry.voxel_volume();
}

std::string percent(double share) {
    return std::to_string(std::lround(100 * share)) + " %";
}

void doubt_surface(const SurfaceFit& fit, double deviation_mm, std::vector<std::string>& reasons) {
    constexpr double least_inliers = 0.5, most_residual = 1.4, most_rival_support = 0.95, least_coverage = 0.25;
    if (fit.inlier_share < least_inliers)
        reasons.push_back("only " + percent(fit.inlier_share) + " of the intraoperative surface lies on the model");
    if (fit.residual_mm > most_residual * std::max(deviation_mm, 0.3))
        reasons.push_back("points of the intraoperative surface lie " + to_text(fit.residual_mm) +
                          " mm from the model where " + to_text(deviation_mm) + " mm were stated");
    if (!fit.pose_searched) return;
    if (fit.coverage < least_coverage)
        reasons.push_back(
            "the points show " + percent(fit.coverage) +
            " of the organ's surface, too little to tell where it lies; show more of it, give pairs of points, or "
            "leave it where the headers place it if they are right (--no-align)");
    if (fit.rival_support > most_rival_support)
        reasons.push_back("the points fit about as well with the organ placed " + to_text(fit.rival_mm) +
                          " mm elsewhere; give a wider patch, or landmarks");
}

void doubt_image(const ImageFit& fit, std::vector<std::string>& reasons) {
    constexpr double least_matched = 0.1, least_shown = 0.5, most_residual_mm = 1.0, least_agreement = 0.1;
    if (fit.matched < least_matched * fit.blocks)
        reasons.push_back("only " + std::to_string(fit.matched) + " of " + std::to_string(fit.blocks) +
                          " blocks of the moving image were found in the fixed one");
    if (fit.shown_share < least_shown)
        reasons.push_back("the fixed image shows only " + percent(fit.shown_share) +
                          " of the organ; the rest is where mechanics alone put it");
    if (fit.agreement && *fit.agreement < least_agreement)
        reasons.push_back("the images agree where the organ lies hardly better than by chance (" +
                          to_text(*fit.agreement) +
                          "; 0 is chance, 1 the same image): check that they show the same organ");
    if (fit.residual_mm > most_residual_mm)
        reasons.push_back("blocks found in the fixed image lie " + to_text(fit.residual_mm) +
                          " mm from where the tissue went");
}

void doubt_points(const PointFit& fit, std::vector<std::string>& reasons) {
    constexpr double most_outliers = 0.2;
    if (fit.outliers > most_outliers * fit.used)
        reasons.push_back(std::to_string(fit.outliers) + " of " + std::to_string(fit.used) +
                          " pairs of points do not fit the tissue; check that they are the same places in both images");
}

/// Across a line an unbiased point lies √2 deviations off in root mean square.
void doubt_curves(const CurveFit& fit, double deviation_mm, std::vector<std::string>& reasons) {
    constexpr double least_inliers = 0.5, most_residual = 1.7;
    if (fit.inlier_share < least_inliers)
        reasons.push_back("only " + percent(fit.inlier_share) +
                          " of the intraoperative points along vessels came near a preoperative curve; check that both "
                          "show the same vessels, and that the headers place the images within a centimetre or two");
    else if (fit.residual_mm > most_residual * deviation_mm)
        reasons.push_back("points along vessels lie " + to_text(fit.residual_mm) + " mm across from the curves where " +
                          to_text(deviation_mm) + " mm along each axis were stated");
}

void doubt_surroundings(const UpdateResult& result, std::vector<std::string>& reasons) {
    constexpr double most_mm = 0.5;
    if (result.contact && result.contact->deepest_mm > most_mm)
        reasons.push_back("the organ lies up to " + to_text(result.contact->deepest_mm) +
                          " mm in a rigid neighbour; check its label and the rigid placement");
    if (result.anchors && result.anchors->largest_mm > most_mm)
        reasons.push_back("anchored tissue was pulled by up to " + to_text(result.anchors->largest_mm) +
                          " mm; check which tissue stays, and the rigid placement");
}

}  // namespace

std::string to_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f", value);
    return text;
}

std::vector<std::string> doubts(const PreparedModel& prepared, const Intraoperative& seen, const UpdateResult& result) {
    std::vector<std::string> reasons;
    const Round& last = result.rounds.back();
    const double spacing = prepared.labels.geometry.spacing.maxCoeff();
    if (seen.labels && 2 * last.matched < last.interface_nodes)
        reasons.push_back("only " + std::to_string(last.matched) + " of " + std::to_string(last.interface_nodes) +
                          " boundary nodes found their boundary in the fixed labels");
    if (seen.labels && last.mean_residual_mm > spacing)
        reasons.push_back("the surfaces still differ by " + to_text(last.mean_residual_mm) +
                          " mm on average, more than a voxel");
    if (last.held_back > last.matched / 50)
        reasons.push_back(std::to_string(last.held_back) + " of " + std::to_string(last.matched) +
                          " matches are still far from where they belong; allow more rounds");
    if (result.cut_short)
        reasons.push_back("the time budget ended the registration after " + std::to_string(result.rounds.size()) +
                          " rounds, the last of which still moved tissue by " + to_text(last.largest_change_mm) +
                          " mm; allow more time, or a coarser mesh");
    if (result.min_jacobian < 0.1)
        reasons.push_back("tissue is compressed to " + to_text(result.min_jacobian) + " of its volume in one element");
    if (result.image) doubt_image(*result.image, reasons);
    if (result.surface) doubt_surface(*result.surface, seen.surface->deviation_mm, reasons);
    if (result.points) doubt_points(*result.points, reasons);
    if (result.curves) doubt_curves(*result.curves, seen.curves->deviation_mm, reasons);
    doubt_surroundings(result, reasons);
    if (!seen.labels) return reasons;
    const double growth = labelled_volume(*seen.labels) / labelled_volume(prepared.labels);
    double poisson = 0;
    for (const auto& [label, material] : prepared.model.materials)
        poisson = std::max(poisson, tled::poisson_ratio(material));
    if (std::abs(growth - 1) > 0.1 && poisson > 0.4)
        reasons.push_back("the labelled volume changed by the factor " + to_text(growth) +
                          ", which tissue of Poisson's ratio " + to_text(poisson) +
                          " resists; for lungs and other tissue that changes volume take 0.3 or less");
    return reasons;
}

}  // namespace tissuewarp::registration::detail
