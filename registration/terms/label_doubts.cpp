#include "registration/terms/label_doubts.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/doubts.hpp"
#include "registration/evaluation.hpp"
#include "registration/evaluation/model_labels.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/pose/label_rivals.hpp"
#include "registration/resection/tissue_gone.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using imaging::LabelExtent;
using imaging::LabelExtents;
using imaging::Volume;

constexpr LabelFitLimits limits = label_fit_limits;

/// Area (mm²) of labelled voxels at the faces of the image.
double cut_area(const LabelBoundaries& map) {
    const auto& grid = map.labels().geometry;
    const LabelExtent box = extent_of_all(map.extents());
    double area = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double face = grid.voxel_volume() / grid.spacing[static_cast<Eigen::Index>(axis)];
        for (const int at : {0, grid.size[axis] - 1}) {
            if (at < box.lower[axis] || at >= box.upper[axis]) continue;
            LabelExtent slice = box;
            slice.lower[axis] = at;
            slice.upper[axis] = at + 1;
            area += face * cv::countNonZero(mask_in(map.labels(), slice, 0).voxels.reshape(1, 1));
        }
    }
    return area;
}

std::string name_of_label(int label) {
    return "label " + std::to_string(label);
}

/// Labels that one of the maps lacks.
void doubt_vanished(const LabelExtents& moving, const LabelExtents& fixed, const std::vector<int>& resected,
                    std::vector<Doubt>& doubts) {
    const auto doubt = [&](int label, std::int64_t voxels, const char* text, const char* remedy) {
        doubts.push_back({"label.vanished", double(voxels), 0, name_of_label(label) + text, remedy,
                          voxels < limits.fewest_voxels ? Severity::Notice : Severity::Doubt});
    };
    for (const auto& [label, extent] : moving)
        if (!fixed.contains(label))
            doubt(label, extent.voxels,
                  " is in the moving labels only: its tissue is where mechanics alone put it, and what is there in the "
                  "fixed labels pulls at the others",
                  "segment it in both, or merge it with what is around it; check the label tables");
    for (const auto& [label, extent] : fixed)
        if (std::find(resected.begin(), resected.end(), label) != resected.end())
            doubt(label, extent.voxels,
                  " is said to be resected, and the fixed labels show it: what is left of it does not move",
                  "give what is left a number of its own in both maps");
        else if (!moving.contains(label))
            doubt(label, extent.voxels, " is in the fixed labels only: no tissue belongs there",
                  "segment it in both, or leave it out; check the label tables");
}

/// The moving labels under the rigid motion that brings all of them together, whatever their numbers, to the fixed.
Volume where_all_labels_together_fit(const Volume& moving, const Volume& fixed, const imaging::Geometry& grid) {
    const Alignment found = registration::align_labels(imaging::mask_of_all(moving), imaging::mask_of_all(fixed));
    Volume placed = moving;
    placed.geometry.origin = found.placement * moving.geometry.origin;
    placed.geometry.direction = found.placement.linear() * moving.geometry.direction;
    return imaging::resample(placed, grid, imaging::Interpolation::Nearest).as(CV_32S);
}

/// Which label of the fixed map a label lies on, of those that lie on another than their own; both on one grid.
std::map<int, int> exchanged_labels(const Volume& shown, const Volume& fixed) {
    std::map<std::pair<int, int>, double> common;
    for (std::int64_t n = 0; n < fixed.geometry.voxel_count(); ++n) {
        const int a = shown.data<std::int32_t>()[n], b = fixed.data<std::int32_t>()[n];
        if (a != 0 && b != 0) common[{a, b}] += 2;
    }
    const LabelExtents in_shown = imaging::label_extents(shown), in_fixed = imaging::label_extents(fixed);
    std::map<int, int> pairs;
    for (auto& [pair, dice] : common) {
        const auto [a, b] = pair;
        const double own = common.contains({a, a}) ? common.at({a, a}) : 0;
        const double all = double(in_shown.at(a).voxels + in_fixed.at(b).voxels);
        if (a != b && dice > limits.least_dice * all && dice > own) pairs[a] = b;
    }
    return pairs;
}

/// Empty where there are none.
std::string text_of_exchange(const std::map<int, int>& pairs) {
    std::string text;
    for (const auto& [moving, fixed] : pairs)
        text += (text.empty() ? "labels seem to be exchanged: " : ", ") + std::to_string(moving) +
                " of the moving map lies where " + std::to_string(fixed) + " of the fixed one does";
    return text;
}

constexpr const char* exchange_remedy = "give the same tissue the same number in both maps";

/// The voxels that a deformed mesh reaches.
LabelExtent box_of(const Eigen::Matrix3Xd& nodes, const imaging::Geometry& grid) {
    const Eigen::Matrix3Xd index = grid.point_to_index() * (nodes.colwise() - grid.origin);
    const Eigen::Vector3d least = index.rowwise().minCoeff(), most = index.rowwise().maxCoeff();
    LabelExtent box{1};
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        const double size = grid.size[a];
        box.lower[a] = static_cast<int>(std::clamp(std::floor(least[axis]), 0.0, size));
        box.upper[a] = static_cast<int>(std::clamp(std::ceil(most[axis]) + 1, 0.0, size));
    }
    return box;
}

LabelExtent about_both(const LabelExtent& a, const LabelExtent& b) {
    LabelExtent box = a;
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (b.lower[axis] < b.upper[axis]) {
            box.lower[axis] = std::min(a.lower[axis], b.lower[axis]);
            box.upper[axis] = std::max(a.upper[axis], b.upper[axis]);
        }
    return box;
}

/// How well the model's own labels fit, on a coarser grid about them and the fixed ones.
class LabelFits {
public:
    LabelFits(const PreparedModel& prepared, LabelBoundaries& moving, LabelBoundaries& fixed,
              const UpdateResult& result)
        : resected_(prepared.options.resected),
          moving_(moving),
          fixed_(fixed),
          mesh_(result.deformation.mesh),
          coarse_(coarsened(fixed.labels(), compared_part(result), limits.grid_mm)),
          shown_(shown_by(result.deformation)),
          after_(overlap(shown_, coarse_)),
          voxel_mm_(std::max(coarse_.geometry.spacing.maxCoeff(), moving.labels().geometry.spacing.maxCoeff())) {}

    [[nodiscard]] std::vector<Doubt> doubts() const {
        std::vector<Doubt> doubts;
        doubt_vanished(moving_.extents(), fixed_.extents(), resected_, doubts);
        for (const auto& [label, fit] : after_)
            if (label != 0 && is_in_both(label)) doubt_fit(label, fit, doubts);
        doubt_worse(doubts);
        doubt_cut(doubts);
        if (auto doubt = doubt_of_labels(tissue_unlabelled(shown_, coarse_))) doubts.push_back(std::move(*doubt));
        return doubts;
    }

    /// Which label of the fixed map a label of the model lies on, of those that lie on another than their own.
    [[nodiscard]] std::map<int, int> exchanged() const {
        std::map<int, int> pairs = exchanged_labels(shown_, coarse_);
        if (!pairs.empty()) return pairs;
        return exchanged_labels(where_all_labels_together_fit(moving_.labels(), fixed_.labels(), coarse_.geometry),
                                coarse_);
    }

    [[nodiscard]] LabelRivals rivals(const UpdateOptions& options, const Eigen::Isometry3d& placement) const {
        return label_rivals(moving_, fixed_, placement, options.alignment);
    }

private:
    std::vector<int> resected_;  // labels that are in no model
    LabelBoundaries &moving_, &fixed_;
    const meshing::TetMesh& mesh_;
    Volume coarse_, shown_;  // fixed labels and those of the model, on one grid
    std::map<int, Overlap> after_;
    double voxel_mm_;

    [[nodiscard]] Volume shown_by(const Deformation& deformation) const {
        return labels_of_model(deformation, moving_.labels(), coarse_.geometry);
    }
    [[nodiscard]] LabelExtent compared_part(const UpdateResult& result) const {
        const imaging::Geometry& grid = fixed_.labels().geometry;
        const LabelExtent before = box_of(result.deformation.mesh.nodes, grid),
                          after = box_of(result.deformation.deformed_nodes(), grid);
        const LabelExtent all = about_both(about_both(extent_of_all(fixed_.extents()), before), after);
        return grown(all, voxels_of(2 * limits.grid_mm, grid), grid);  // beyond the grid boundaries have no faces
    }

    [[nodiscard]] bool is_in_both(int label) const {
        return moving_.extents().contains(label) && fixed_.extents().contains(label);
    }

    /// Of more voxels of the comparison's grid than a speck.
    [[nodiscard]] bool is_speck(int label) const {
        const double least = limits.fewest_voxels * coarse_.geometry.voxel_volume();
        const auto is_small = [&](const LabelBoundaries& map) {
            return double(map.extents().at(label).voxels) * map.labels().geometry.voxel_volume() < least;
        };
        return is_small(moving_) && is_small(fixed_);
    }

    void doubt_fit(int label, const Overlap& fit, std::vector<Doubt>& doubts) const {
        const double apart = fit.mean_surface_distance_mm;
        if (!std::isfinite(apart) && is_speck(label)) return;  // between the voxels of the grid
        const Severity severity = is_speck(label) ? Severity::Notice : Severity::Doubt;
        const std::string distance =
            std::isfinite(apart) ? "lies " + to_text(apart) + " mm from it on average" : "is out of its image";
        constexpr const char* remedy = "look where this label went; check that it is the same tissue in both maps";
        const double most_mm = std::max(limits.most_apart_mm, limits.most_apart_voxels * voxel_mm_);
        if (fit.dice < limits.least_dice && apart > limits.within_voxels * voxel_mm_)
            doubts.push_back({"label.overlap", fit.dice, limits.least_dice,
                              name_of_label(label) + " overlaps the fixed one by a Dice of " + to_text(fit.dice) +
                                  " only and " + distance,
                              remedy, severity});
        else if (apart > most_mm)
            doubts.push_back({"label.apart", apart, most_mm,
                              name_of_label(label) + " of the model " + distance + " in the fixed labels", remedy,
                              severity});
    }

    void doubt_worse(std::vector<Doubt>& doubts) const {
        const double after = after_.at(0).dice;
        if (after >= 1 - limits.most_worse) return;
        const Deformation at_rest{mesh_, Eigen::Matrix3Xd::Zero(3, mesh_.nodes.cols()), Eigen::Isometry3d::Identity()};
        const double before = dice_of_all(shown_by(at_rest));
        if (after < before - limits.most_worse)
            doubts.push_back({"labels.worse", after, before,
                              "all labels together overlap less than before the registration: Dice " + to_text(before) +
                                  " → " + to_text(after),
                              "leave them where the headers place them, or check the labels"});
    }

    [[nodiscard]] double dice_of_all(const Volume& shown) const {
        std::int64_t in_one = 0, in_both = 0;
        for (std::int64_t n = 0; n < coarse_.geometry.voxel_count(); ++n) {
            const bool a = shown.data<std::int32_t>()[n] != 0, b = coarse_.data<std::int32_t>()[n] != 0;
            in_one += a + b;
            in_both += a && b;
        }
        return in_one > 0 ? 2 * double(in_both) / double(in_one) : 0;
    }

    void doubt_cut(std::vector<Doubt>& doubts) const {
        const auto share = [](const LabelBoundaries& map) {
            return cut_area(map) / (6 * std::pow(labelled_volume(map.extents(), map.labels().geometry), 2.0 / 3));
        };
        const double more = share(fixed_) - share(moving_);
        if (std::abs(more) <= limits.most_cut) return;
        const std::string cut = more > 0 ? "fixed" : "moving", whole = more > 0 ? "moving" : "fixed";
        doubts.push_back({"labels.cut_off", std::abs(more), limits.most_cut,
                          "the border of the image cuts the organ off in the " + cut + " labels and not in the " +
                              whole + " ones (" + percent(std::abs(more)) +
                              " of its surface): what lies at the cut and beyond is where mechanics alone put it",
                          "do not trust tissue there; give labels of all of the organ, or cut both maps alike"});
    }
};

std::optional<Doubt> doubt_of_pairing(const LabelFits& fits) {
    const std::map<int, int> pairs = fits.exchanged();
    if (pairs.empty()) return std::nullopt;
    return Doubt{"labels.exchanged", double(pairs.size()), 0, text_of_exchange(pairs), exchange_remedy};
}

std::optional<Doubt> doubt_of_pose(const LabelFits& fits, const UpdateOptions& options, const UpdateResult& result) {
    const LabelRivals rivals = fits.rivals(options, result.alignment.placement);
    const double found = rivals.found_mm, best = std::min(found, rivals.turned_mm);
    if (is_better_rival(rivals.mirrored_mm, best))
        return Doubt{"labels.mirrored", rivals.mirrored_mm, label_rival_options.better * best,
                     "the mirror image of the moving labels fits better: its boundaries lie " +
                         to_text(rivals.mirrored_mm) + " mm from the fixed ones instead of " + to_text(best) + " mm",
                     "check the orientation of both label maps: left and right seem to be exchanged in one"};
    if (rivals.turned_deg > label_rival_options.least_turn_deg && is_better_rival(rivals.turned_mm, found))
        return Doubt{"labels.turned", rivals.turned_mm, label_rival_options.better * found,
                     "the labels fit better turned by another " + std::to_string(std::lround(rivals.turned_deg)) +
                         "°: their boundaries lie " + to_text(rivals.turned_mm) + " mm apart instead of " +
                         to_text(found) + " mm",
                     "turn one of the images by about as much beforehand"};
    return std::nullopt;
}

/// Labels that lie elsewhere, as opposed to those that a map lacks or that its image cuts off.
bool is_misplaced(const std::vector<Doubt>& doubts) {
    return std::any_of(doubts.begin(), doubts.end(), [](const Doubt& doubt) {
        return doubt.severity == Severity::Doubt && doubt.code != "labels.cut_off" && doubt.code != "label.vanished" &&
               doubt.code != "resected.untold";
    });
}

}  // namespace

std::string why_nothing_matches(const LabelBoundaries& moving, const LabelBoundaries& fixed) {
    const Volume to = coarsened(fixed.labels(), limits.grid_mm);
    const std::string exchange = text_of_exchange(
        exchanged_labels(where_all_labels_together_fit(moving.labels(), fixed.labels(), to.geometry), to));
    return exchange.empty() ? "check that the images show the same organ" : exchange + "; " + exchange_remedy;
}

std::vector<Doubt> doubts_of_labels(const PreparedModel& prepared, LabelBoundaries& moving, LabelBoundaries& fixed,
                                    const UpdateOptions& options, const UpdateResult& result) {
    const LabelFits fits(prepared, moving, fixed, result);
    std::vector<Doubt> doubts = fits.doubts();
    const double most_mm = label_pose_limits.most_distance_mm;
    if (result.alignment.mean_distance_mm > most_mm)
        doubts.push_back({"alignment.apart", result.alignment.mean_distance_mm, most_mm,
                          "after the rigid alignment the boundaries still lay " +
                              to_text(result.alignment.mean_distance_mm) + " mm apart on average",
                          "check that both label maps show the same organ, placed alike"});
    if (count_of_severe(doubts) == 0) return doubts;
    std::optional<Doubt> cause = doubt_of_pairing(fits);
    if (!cause && is_misplaced(doubts)) cause = doubt_of_pose(fits, options, result);
    if (cause) doubts.insert(doubts.begin(), std::move(*cause));
    return doubts;
}

}  // namespace tissuewarp::registration::detail
