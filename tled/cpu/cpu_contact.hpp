#pragma once
/// Contact with rigid bodies (nodal_effects.hpp) by the internal numbers of the CPU engine.

#include "tled/cpu/cpu_effects.hpp"
#include "tled/nodal_effects.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace tissuewarp::tled::detail {

/// The tangent plane of an obstacle's distance where a node was when it last looked.
struct Tangent {
    Eigen::Vector3d from = Eigen::Vector3d::Zero();    ///< displacement of the node, mm
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< outward, unit vector
    double height = 0.0;         ///< of the node above the plane, mm; +∞ outside of the obstacle's grid
    double reach_squared = 0.0;  ///< mm²; nearer to `from` the node is outside the obstacle if it is above the plane,
                                 ///< and inside by its depth below it

    [[nodiscard]] double height_at(const Eigen::Vector3d& u) const { return height + normal.dot(u - from); }
    /// How far a node at displacement u may go and stay outside, mm.
    [[nodiscard]] double free_way(const Eigen::Vector3d& u) const {
        return std::min(height_at(u), std::sqrt(reach_squared) - (u - from).norm());
    }
};

/// Steps look at the samples of an obstacle only where a node has left the reach of its last look: few nodes are near
/// an obstacle, and those that touch it move by micrometres a step. In float64 whatever the engine computes in, because
/// the surface is a matter of micrometres too.
class CpuContact {
public:
    CpuContact(const NodalContact& contact, const std::vector<std::uint32_t>& internal);

    /// Takes other conditions where the same nodes meet the same bodies at the same places, and what nodes have seen of
    /// these stays true; else returns false.
    bool take(const NodalContact& contact);

    /// To be called where nodes have moved otherwise than by steps: what follows does not depend on what went before.
    void forget_looks();

    /// Whether a body's velocity depends on the place: what settle() must know.
    [[nodiscard]] bool turning() const { return turns(obstacles_); }

    /// s, of the steps that follow.
    void set_time_step(double time_step) { time_step_ = time_step; }

    /// Puts internal nodes [begin, end) that have entered an obstacle back, in components that are free. Arrays of
    /// records, mm. `turning` is std::true_type or std::false_type, as turning() says.
    template <class Turning, class T>
    void settle(Turning turning, std::size_t begin, std::size_t end, const T* free, T* v, T* u) {
        const auto [first, last] = of_nodes(point_, begin, end);
        for (Point* point = first; point != last; ++point) {
            const std::size_t at = point->node * std::size_t{record};
            const Eigen::Vector3d here = vector_at(u + at);
            if ((here - point->from).squaredNorm() < point->free_squared) continue;
            const Motion after = settled(turning, *point, {here, vector_at(v + at)});
            if (after.u == here) {
                set_free(*point, here);
                continue;
            }
            for (std::size_t c = 0; c < 3; ++c) {
                if (free[at + c] == T(0)) continue;
                u[at + c] = T(after.u[static_cast<Eigen::Index>(c)]);
                v[at + c] = T(after.v[static_cast<Eigen::Index>(c)]);
            }
        }
    }

private:
    struct Point {
        std::uint32_t node, entry;                       // internal; of NodalContact
        Eigen::Vector3d from = Eigen::Vector3d::Zero();  // displacement, mm
        double free_squared = 0.0;                       // mm²; nearer to `from` it is outside all obstacles
    };

    template <class T>
    static Eigen::Vector3d vector_at(const T* record_of_node) {
        return {double(record_of_node[0]), double(record_of_node[1]), double(record_of_node[2])};
    }

    Tangent& tangent(const Point& point, std::size_t obstacle) {
        return tangent_[point.entry * obstacles_.size() + obstacle];
    }

    /// How far an obstacle goes at a point in a step, mm.
    template <class Turning>
    [[nodiscard]] Eigen::Vector3d increment_of(Turning turning, const Obstacle& obstacle,
                                               const Eigen::Vector3d& x) const {
        Eigen::Vector3d velocity = obstacle.velocity.of_origin;
        if constexpr (turning) velocity += obstacle.velocity.spin.cross(x);
        return time_step_ * velocity;
    }

    /// As in_contact() has it.
    template <class Turning>
    Motion settled(Turning turning, const Point& point, Motion motion) {
        for (std::size_t o = 0; o < obstacles_.size(); ++o) {
            Tangent& tangent = this->tangent(point, o);
            if (!((motion.u - tangent.from).squaredNorm() < tangent.reach_squared))
                tangent = look(o, position_.col(point.entry), motion.u);
            const double depth = -tangent.height_at(motion.u);
            if (!(depth > 0)) continue;
            const Eigen::Vector3d slip =
                motion.v - increment_of(turning, obstacles_[o], position_.col(point.entry) + motion.u);
            const Eigen::Vector3d correction = contact_correction(tangent.normal, depth, obstacles_[o].friction, slip);
            motion.u += correction;
            motion.v += correction;
        }
        return motion;
    }

    /// After a step that found it outside all obstacles at displacement u.
    void set_free(Point& point, const Eigen::Vector3d& u) {
        double free = std::numeric_limits<double>::infinity();
        for (std::size_t o = 0; o < obstacles_.size(); ++o) free = std::min(free, tangent(point, o).free_way(u));
        point.from = u;
        point.free_squared = free > 0 ? free * free : 0.0;
    }

    [[nodiscard]] Tangent look(std::size_t obstacle, const Eigen::Vector3d& X, const Eigen::Vector3d& u) const;

    double time_step_ = 0;
    std::vector<int> node_;  // as they were given
    std::vector<Obstacle> obstacles_;
    std::vector<GridReach> reach_;  // of each
    Eigen::Matrix3Xd position_;     // by entry of NodalContact, at rest, mm
    std::vector<Point> point_;      // ascending
    std::vector<Tangent> tangent_;  // of each entry, of each obstacle
};

}  // namespace tissuewarp::tled::detail
