#pragma once
/// A random organ with a tumour, all of it or a part resected, and what becomes of it by finite elements.

#include "study/detail/truth.hpp"

#include "core/observer.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace tissuewarp::study::detail {

enum class Access {
    None,     ///< the cavity is closed
    Corridor  ///< it is open to the outside the shortest way
};

/// The organ's inclusion is the tumour. What is taken out of the organ is an ellipsoid: all of the tumour, or one that
/// leaves a part of it on one side and takes healthy tissue on the other. A corridor to it is a round channel, whose
/// rims are rounded off.
class ResectedShape {
public:
    /// Cavities of 10 to 60 ml without the corridor. Throws InvalidInput where the tumour that fits is smaller, and
    /// where it lies deeper than a corridor goes.
    explicit ResectedShape(Random& random, Access access = Access::None);

    /// At a point at rest (LPS mm): 0 outside, 1 organ, 2 what is gone, 3 tumour that is left.
    [[nodiscard]] int label(const Eigen::Vector3d& point) const;
    /// About the distance to the wall of the cavity, negative in it, mm.
    [[nodiscard]] double cavity_distance(const Eigen::Vector3d& point) const;
    /// The point of the nearer one of outer surface and wall near a point; the point itself where neither is, and at
    /// rims.
    [[nodiscard]] Eigen::Vector3d on_surface(const Eigen::Vector3d& point) const;

    [[nodiscard]] const OrganShape& organ() const { return organ_; }
    [[nodiscard]] bool leaves_tumour() const { return scale_ < 1; }
    /// Whether surface and wall of an open cavity, or cavity and corridor, round into one another about there.
    [[nodiscard]] bool at_rim(const Eigen::Vector3d& point) const;
    [[nodiscard]] bool is_open() const { return corridor_.has_value(); }
    [[nodiscard]] double cavity_ml() const;                                                    ///< without the corridor
    [[nodiscard]] double cavity_radius() const { return scale_ * organ_.inclusion_radius(); }  ///< mm
    /// Unit normal of the wall into the tissue.
    [[nodiscard]] Eigen::Vector3d wall_normal(const Eigen::Vector3d& point) const;

private:
    /// Round channel from a place on, without an end.
    struct Corridor {
        Eigen::Vector3d from, along;
        double radius_mm;
    };

    OrganShape organ_;
    double scale_ = 1;  ///< of the cavity to the tumour
    Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
    std::optional<Corridor> corridor_;

    [[nodiscard]] double corridor_distance(const Eigen::Vector3d& point) const;
    [[nodiscard]] Corridor shortest_way_out(double radius_mm) const;
    /// Of the tissue left, negative in it.
    [[nodiscard]] double surface_distance(const Eigen::Vector3d& point) const;

    /// Where the tumour has the point that the cavity has here.
    [[nodiscard]] Eigen::Vector3d in_tumour(const Eigen::Vector3d& point) const;
};

/// Everything that both truths of a patient follow from.
struct ResectedOrgan {
    ResectedShape shape;
    RandomTissue tissue;
    RandomLoads loads;      ///< from outside
    double relief_kpa = 0;  ///< that the tumour pressed with and the wall now lacks, along the normal into the cavity
    bool air = false;       ///< in the cavity, else fluid
    std::string words;
};
ResectedOrgan random_resection(Random& random, Access access = Access::None);

/// The organ without what is gone and the whole of it, each on a mesh of its own of about so many elements. Throws
/// InvalidInput where a curved element of either is turned inside out: a patient has both or none.
struct ResectionMeshes {
    TruthMesh resected, whole;
};
ResectionMeshes resection_meshes(const ResectedOrgan& organ, int elements, Observer& observer);

/// Equilibrium under loads that linear elasticity would move by no more than `motion_mm`; without what is gone also
/// under what the wall lacks. Throw as equilibrium().
Truth resected_truth(const ResectedOrgan& organ, TruthMesh mesh, double motion_mm, Observer& observer);
Truth unresected_truth(const ResectedOrgan& organ, TruthMesh mesh, double motion_mm, Observer& observer);

}  // namespace tissuewarp::study::detail
