#pragma once
/// A segmented intraoperative volume: interface nodes of the deformed mesh belong on the boundaries of its labels.

#include "registration/boundary/label_boundary_field.hpp"
#include "registration/options.hpp"
#include "registration/pose/label_boundaries.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/datum_kind.hpp"
#include "registration/terms/term.hpp"

namespace tissuewarp::registration::detail {

/// What labels may show without a doubt. Chosen by hand; on which data is not recorded.
struct LabelDoubtLimits {
    double least_matched = 0.5;       ///< share of the boundary nodes that found their boundary
    double most_residual_voxels = 1;  ///< mean distance of the boundaries after the last round, largest spacing
    double most_growth = 0.1;         ///< of the labelled volume, relative, either way; the lung's masks have 0.15
    double resisting_poisson = 0.4;   ///< Poisson's ratio above which tissue resists such a change
};
inline constexpr LabelDoubtLimits label_doubt_limits{};

/// What updates of one model share.
struct LabelTools {
    LabelBoundaries moving;                    ///< of the model's labels
    std::vector<std::vector<int>> neighbours;  ///< of interface nodes
    std::map<int, double> thickness_mm;        ///< of each label

    explicit LabelTools(const PreparedModel& prepared);
};

class LabelTerm : public Term {
public:
    /// Model and options outlive this. Throws InvalidInput where the fixed labels hold none of the model's.
    LabelTerm(const PreparedModel& prepared, std::shared_ptr<LabelTools> tools, const imaging::Volume& fixed_labels,
              const UpdateOptions& options);

    [[nodiscard]] Shows shows() const override { return Shows::Boundary; }
    [[nodiscard]] PoseClaim pose_claim() const override { return PoseClaim::WholeSurface; }
    [[nodiscard]] HardlyTold hardly_told() const override { return hardly_told_motions.labels; }
    [[nodiscard]] Alignment pose(const Eigen::Isometry3d& start, Observer& observer) override;
    /// Springs from every interface node along its normal to the boundary in the fixed labels. Throws InvalidInput when
    /// no boundary was found.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;
    void judge(const State& state, UpdateResult& result) override;

private:
    const PreparedModel& prepared_;
    std::shared_ptr<LabelTools> tools_;
    LabelBoundaries fixed_;
    const UpdateOptions& options_;
    LabelBoundaryField boundaries_;  // of the fixed labels
    Contribution last_;              // without its springs
};

/// Of the labelled volume, where it grew by more than the factor or shrank by more than one over it.
std::optional<Doubt> doubt_of_growth(const imaging::Volume& moving, const imaging::Volume& fixed, double most_growth);

}  // namespace tissuewarp::registration::detail
