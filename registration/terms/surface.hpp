#pragma once
/// Points of a part of the organ's surface: the tissue's surface goes through them.

#include "meshing/search/surface_tree.hpp"
#include "registration/options.hpp"
#include "registration/pose/surface_data.hpp"
#include "registration/pose/surface_pose.hpp"
#include "registration/springs/pull.hpp"
#include "registration/terms/datum_kind.hpp"
#include "registration/terms/organ_surface.hpp"
#include "registration/terms/term.hpp"

#include <memory>
#include <vector>

namespace tissuewarp::registration::detail {

/// How points of a surface pull beside SurfaceOptions. Chosen by hand; on which data is not recorded.
struct SurfacePullOptions {
    double least_deviation_mm = 0.3;  ///< that points are taken for: the model's own surface is no better
};
inline constexpr SurfacePullOptions surface_pull_options{};

/// What is to be said against a registration that fits so.
std::vector<Doubt> doubts_of(const SurfaceFit& fit, double deviation_mm);

/// What points of a surface may show without a doubt. Chosen by hand, but for the coverage; on which data is not
/// recorded.
struct SurfaceDoubtLimits {
    double least_inliers = 0.5;  ///< share of the points within the scale of the last round of the surface
    double most_residual = 1.4;  ///< root mean square along the normals over the stated deviation
    /// Share of the organ's surface that the points show. On less of a smooth organ another pose may fit as well.
    /// Chosen on draws 441 to 1160 of the liver phantom's surface, where 0.18 had missed two failures; reported on
    /// others from 1281 on (docs/lab/results.md).
    double least_coverage = 0.25;
    /// Normals point inwards where the headers place this share of the points within so many mm of the model, and of
    /// those this share against its normals: a search of the pose puts such a patch on the other side of the organ, and
    /// fits it there. Beyond what tissue sinks, far below what an organ measures.
    double headers_reach_mm = 20, least_near = 0.8, least_inward = 0.8;
};
inline constexpr SurfaceDoubtLimits surface_doubt_limits{};

class SurfaceTerm : public Term {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation. Throws InvalidInput for
    /// points that cannot be used.
    SurfaceTerm(const PreparedModel& prepared, std::shared_ptr<const OrganSurface> organ, const SurfacePoints& points,
                const SurfaceOptions& options, const AlignmentOptions& alignment, double energy);

    [[nodiscard]] Shows shows() const override { return Shows::Parts; }
    [[nodiscard]] PoseClaim pose_claim() const override { return PoseClaim::Anywhere; }
    [[nodiscard]] HardlyTold hardly_told() const override { return hardly_told_motions.surface; }
    /// The rigid placement, searched for all over the organ. Throws Cancelled.
    [[nodiscard]] Alignment pose(const Eigen::Isometry3d& start, Observer& observer) override;
    [[nodiscard]] bool take_over(const UpdateResult& last) override;

    /// Pulls of the points on the surface of the deformed mesh, along the normals alone. Throws InvalidInput when no
    /// point lies near the model.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;
    void judge(const State& state, UpdateResult& result) override;

private:
    struct Match {
        bool found = false;
        meshing::SurfaceTree::Hit hit;
        Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, moving frame
        double distance_mm = 0;                            // along it, from the surface to the point
    };

    /// What the search for the placement told.
    struct PoseFound {
        bool searched = false;
        double rival_mm = 0, rival_support = 0;
    };

    const PreparedModel& prepared_;
    const SurfaceOptions& options_;
    const AlignmentOptions& alignment_;
    SurfaceData data_;
    std::shared_ptr<const OrganSurface> surface_;
    double energy_;       // mN mm that one standard deviation weighs
    FallingScale scale_;  // of the robust weights
    PoseFound pose_;
    bool inward_;  // the normals that were given, where the headers place the points

    [[nodiscard]] bool normals_point_inwards() const;
    [[nodiscard]] std::vector<Match> matches(const State& state, double reach_mm) const;
    [[nodiscard]] double final_scale_mm() const;
    [[nodiscard]] SurfaceFit fit(const State& state) const;
    [[nodiscard]] Pull pull_of(const Match& match, double area, double weight, const State& state,
                               double most_step_mm) const;
};

}  // namespace tissuewarp::registration::detail
