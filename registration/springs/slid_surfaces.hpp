#pragma once
/// Surfaces of tissue that slide on one another, where they have slid to.

#include "registration/prepare.hpp"

#include <Eigen/Core>

#include <map>
#include <vector>

namespace tissuewarp::registration::detail {

/// Where a node lies on the other surface. Chosen by hand.
struct SlidSurfaceOptions {
    double reach_mm = 20;  ///< a pair whose nodes both lie farther than this from the other surface stays as it is
    double most_beside_mm = 0.5;  ///< … or beside its rim, and farther than above it
    double least_cosine = 0.5;  ///< between a node's normal and that of the place of the other surface that it lies on
};
inline constexpr SlidSurfaceOptions slid_surface_options{};

/// A pair of nodes (tled::SlidingPair) keeps them at one height along the normal at rest. Where a round surface slid by
/// s that is wrong by s²/2R: each node lies on another place of the other surface by then. The forces say so from round
/// to round, as nodes against surfaces in contact mechanics are linearised [Wriggers, Computational Contact Mechanics,
/// 2006, chapter 9].
class SlidSurfaces {
public:
    /// The model outlives this.
    explicit SlidSurfaces(const PreparedModel& prepared);

    /// Forces on nodes, 3 × N, mN, by which every pair rests where its nodes lie on the other's surface, as far as can
    /// be told at a displacement (3 × N, mm); 3 × 0 where nothing slides.
    [[nodiscard]] Eigen::Matrix3Xd forces(const Eigen::Matrix3Xd& displacement) const;

private:
    /// Faces of one label along which another slides, outward.
    struct Side {
        std::vector<int> nodes;                 ///< of the mesh
        std::map<int, int> place;               ///< of a node of the mesh in `nodes`
        std::vector<std::array<int, 3>> faces;  ///< of places in `nodes`

        void add(const std::array<int, 3>& face);
    };
    struct Interface {
        Side first, second;
        std::vector<tled::SlidingPair> pairs;
    };

    const PreparedModel& prepared_;
    std::vector<Interface> interfaces_;

    void add_forces(const Interface& interface, const Eigen::Matrix3Xd& displacement, Eigen::Matrix3Xd& forces) const;
};

}  // namespace tissuewarp::registration::detail
