#pragma once
/// All terms of one registration. A new kind of datum is a pair of files here and a line in terms_of().

#include "registration/intraoperative.hpp"
#include "registration/loads/load_finder.hpp"
#include "registration/matching/dense/image_engine.hpp"
#include "registration/pose/seen_bodies.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/labels.hpp"
#include "registration/terms/organ_surface.hpp"
#include "registration/terms/term.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

class Terms {
public:
    /// `energy` (mN mm) weighs as much as one standard deviation of a datum; without `align` the images are in one
    /// frame already.
    Terms(std::vector<std::unique_ptr<Term>> terms, double energy, bool align);

    /// Points alone show the organ.
    [[nodiscard]] bool parts_alone() const { return parts_alone_; }
    /// With the surface where points show the organ wherever it lies, and nothing says where that is.
    [[nodiscard]] PriorMoves prior_moves() const;
    /// The data say where the organ lies as a whole.
    [[nodiscard]] bool placement_sought() const { return placement_sought_; }
    /// Of the data that do: the farther they turned the organ of these nodes (3 × N, mm), the more of a turn that they
    /// do not tell is to be expected; any turn where they tell a shift alone. Nothing where headers place the organ.
    [[nodiscard]] HardlyShown hardly_shown(const Eigen::Isometry3d& placement, const Eigen::Matrix3Xd& nodes) const;
    /// They say how far it was shifted, and not how it turned.
    [[nodiscard]] bool shift_alone() const;
    /// Loads that nobody stated and that data may tell: of points of a free organ whatever bends it, since that also
    /// moves what no point shows; of labels, which show the boundary all over, whatever presses on it there, a force
    /// within. Otherwise none.
    [[nodiscard]] std::optional<LoadKind> unknown_loads() const { return unknown_loads_; }
    /// Springs differ from those that the model was prepared with, or few of them are the same.
    [[nodiscard]] bool take_own_metric() const { return take_own_metric_; }
    [[nodiscard]] double energy() const { return energy_; }

    /// The rigid placement by the term that claims most, from where one of a lesser claim shifts the organ.
    [[nodiscard]] Alignment pose(Observer& observer);
    /// In its place, what the search for it told an earlier update. False where some term must search again.
    [[nodiscard]] bool take_over(const UpdateResult& last);
    [[nodiscard]] int searches() const;
    [[nodiscard]] bool gains() const;
    /// The sum, springs in the order of their origins.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer);
    [[nodiscard]] bool follow(const State& solved);
    [[nodiscard]] bool settled(const State& state) const;
    void judge(const State& state, UpdateResult& result);

private:
    std::vector<std::unique_ptr<Term>> terms_;
    double energy_;
    bool parts_alone_, placement_sought_, free_placement_, take_own_metric_;
    std::optional<LoadKind> unknown_loads_;

    [[nodiscard]] bool any_shows(Shows what) const;
    [[nodiscard]] Term& best_placed() const;
};

/// What the updates of one model share.
struct SharedTools {
    std::vector<ImageTools> images;             ///< for the image of the model and each of its contrasts
    std::shared_ptr<const OrganSurface> organ;  ///< made where points of a surface are first seen
    std::shared_ptr<LabelTools> labels;         ///< made where labels are first seen
};

/// Terms of what was seen, of what the model has about it and of the loads stated, with what is expected of tissue that
/// no datum shows; `bodies` are rigid neighbours that were seen too. Model, data, options and tools outlive them.
/// Throws InvalidInput when there is nothing to register to, an image but no model of one, no label in common, or data
/// that cannot be used.
Terms terms_of(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
               SharedTools& tools, std::vector<SeenBody> bodies = {});

}  // namespace tissuewarp::registration::detail
