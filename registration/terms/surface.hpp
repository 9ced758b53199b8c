#pragma once
/// Points of a part of the organ's surface: the tissue's surface goes through them.

#include "registration/pose/surface_pose.hpp"
#include "registration/search/surface_tree.hpp"
#include "registration/terms/pull.hpp"
#include "registration/terms/surface_data.hpp"
#include "registration/terms/term.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

class SurfaceEvidence {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation. Throws InvalidInput for
    /// points that cannot be used.
    SurfaceEvidence(const PreparedModel& prepared, const SurfacePoints& surface, const SurfaceOptions& options,
                    double energy);

    /// The rigid placement, searched for all over the organ. Throws Cancelled.
    Alignment align(const AlignmentOptions& options, Observer& observer);

    /// Pulls of the points on the surface of the deformed mesh, along the normals alone. Throws InvalidInput when no
    /// point lies near the model.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state);

    /// How the surface of the model lies to the points.
    [[nodiscard]] SurfaceFit fit(const State& state) const;

private:
    struct Match {
        bool found = false;
        SurfaceTree::Hit hit;
        Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, moving frame
        double distance_mm = 0;                            // along it, from the surface to the point
    };

    const PreparedModel& prepared_;
    const SurfaceOptions& options_;
    SurfaceData data_;
    meshing::SurfaceMesh surface_;  // at rest, on the label boundary
    std::vector<int> node_of_;      // mesh nodes of its nodes
    std::vector<int> tet_of_;       // tetrahedra of its triangles
    double energy_;                 // mN mm that one standard deviation weighs
    double first_scale_mm_ = 0;     // of the robust weights
    SurfacePose pose_;

    void take_surface();
    [[nodiscard]] meshing::SurfaceMesh deformed_surface(const Eigen::Matrix3Xd& displacement) const;
    [[nodiscard]] std::vector<Match> matches(const State& state, double reach_mm) const;
    [[nodiscard]] double final_scale_mm() const;
    [[nodiscard]] Pull pull_of(const Match& match, double area, double weight, const State& state,
                               double most_step_mm) const;
};

}  // namespace tissuewarp::registration::detail
