#pragma once
/// Rigid neighbours that the organ's surface does not enter.

#include "registration/terms/term.hpp"

#include "imaging/sampling.hpp"
#include "registration/pose/seen_bodies.hpp"
#include "registration/prepare.hpp"

#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

/// How contact is solved and what is said of it. Chosen by hand; on which data is not recorded.
struct ContactOptions {
    double tolerance_mm = 0.05;  ///< of a gap: far below a voxel
    double deviation_mm = 0.1;   ///< of the spring of a node that touches, over the area that the ground takes for
                                 ///< independent: decides how fast pushes converge, not where
    double most_depth_mm = 0.5;  ///< of any node in a neighbour, beyond which the result is doubted
};
inline constexpr ContactOptions contact_options{};

/// Unilateral contact of surface nodes without friction, by the augmented Lagrangian with an active set [Simo and
/// Laursen 1992]. The gap g of a node is its distance to the neighbours, plus how deep it lay in them at rest, so that
/// nothing moves an organ that did not move. Neighbours move with the placement, or as fixed labels show them to have
/// moved, which the first round decides. Where a node touches, a spring of stiffness k along the normal alone draws
/// g to the push s, and s becomes max(0, s − g) after every equilibrium: k s is the pressure that then holds with g =
/// 0, whatever k is. A node comes off where its spring would have to hold it back.
class ContactTerm : public Term {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation; `seen` are neighbours that
    /// may have moved on their own. Precondition: the model has neighbours.
    ContactTerm(const PreparedModel& prepared, double energy, std::vector<SeenBody> seen = {});

    [[nodiscard]] Shows shows() const override { return Shows::Place; }
    /// Springs on the nodes that touch, from where they are.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

    /// Takes note of an equilibrium under these springs: pushes, nodes that came off, and nodes that
    /// entered a neighbour. Whether there are such: then the equilibrium is to be sought again from where it started.
    [[nodiscard]] bool follow(const State& solved) override;

    /// Whether contact is in balance: no node lies deeper than 0.05 mm in a neighbour, and none is held back.
    [[nodiscard]] bool settled(const State& state) const override;

    void judge(const State& state, UpdateResult& result) override;

private:
    struct SurfaceNode {
        int node = -1;
        double area = 0;  // mm²
        bool touches = false;
        double push = 0;  // mm
    };
    struct Gap {
        double distance = 0;                               // mm, negative within a neighbour
        Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, away from it
    };

    /// A body, or all that move with the placement.
    struct Obstacle {
        imaging::LinearSampler distance;          // where it lay at rest
        std::vector<double> rest_depth;           // of each surface node, mm
        std::optional<Eigen::Isometry3d> motion;  // moving → fixed; none: the placement
    };

    const PreparedModel& prepared_;
    std::vector<SeenBody> seen_;
    std::vector<BodyMotion> bodies_;
    double stiffness_;  // kPa/mm
    std::vector<SurfaceNode> nodes_;
    std::vector<Obstacle> obstacles_;  // none before the first round

    /// In the first round, by the placement that it has.
    void know_obstacles(const State& state, Observer& observer);
    [[nodiscard]] Obstacle obstacle(const imaging::Volume& distance,
                                    const std::optional<Eigen::Isometry3d>& motion) const;

    [[nodiscard]] ContactFit fit(const State& state) const;
    /// To the nearest obstacle.
    [[nodiscard]] Gap gap(std::size_t n, const State& state) const;
};

}  // namespace tissuewarp::registration::detail
