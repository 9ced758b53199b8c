#pragma once
/// Nearest places on polylines.

#include "meshing/search/point_tree.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <vector>

namespace tissuewarp::meshing {

/// A piece of a line between two of its points, and the two others of the line whose chord is its tangent.
struct Segment {
    std::array<int, 2> ends{};
    std::array<int, 2> chord{};
};

/// Which segments a query accepts: those within an angle of a tangent of either sign.
struct TangentGate {
    Eigen::Vector3d tangent = Eigen::Vector3d::Zero();  ///< unit; zero accepts every segment
    double least_cosine = 0;
};

/// Searches a tree of the middles of segments. A segment is no nearer than its middle less half its length, which
/// bounds the search: the place found is the nearest of all that the gate accepts.
class CurveTree {
public:
    /// Points 3 × P, mm, and the segments between them.
    CurveTree(Eigen::Matrix3Xd points, std::vector<Segment> segments);

    struct Hit {
        int segment = -1;
        double along = 0;                                   ///< 0 at the first end, 1 at the second
        Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< the nearest place
        Eigen::Vector3d tangent = Eigen::Vector3d::Zero();  ///< unit
        double distance = 0;                                ///< mm
    };
    /// The nearest place within `reach` (mm), the lowest segment among equals; nothing where there is none.
    /// Thread-safe.
    [[nodiscard]] std::optional<Hit> nearest(const Eigen::Vector3d& query, double reach, const TangentGate& gate) const;

    /// 3 × P, mm.
    [[nodiscard]] const Eigen::Matrix3Xd& points() const { return points_; }

private:
    Eigen::Matrix3Xd points_;
    std::vector<Segment> segments_;
    Eigen::Matrix3Xd middles_, tangents_;  // of the segments
    double longest_half_ = 0;              // mm
    PointTree tree_;                       // of the middles

    void visit(int segment, const Eigen::Vector3d& query, const TangentGate& gate, Hit& best) const;
};

}  // namespace tissuewarp::meshing
