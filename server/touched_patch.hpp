#pragma once
/// A patch of the organ's surface that grows touch by touch: by a tracked stylus that is drawn over it, or by points
/// that a client sends one after the other.

#include "server/messages.hpp"

#include <string>
#include <vector>

namespace tissuewarp::server {

/// How a stylus is listened to.
struct Gathering {
    std::string device = {};  ///< whose transforms are places of the tip; empty: none
    std::string id = {};      ///< of what it touches
    double spacing_mm = 1;    ///< nearer to a younger touch it says nothing new
    double keep_s = 0;        ///< older touches fade; 0: none does
};

class TouchedPatch {
public:
    /// A place that the stylus passed, by the sender's clock (s; 0: not known). Where a touch of the last second lies
    /// within the spacing nothing changes; older ones there give way, since tissue moves. Touches that are too old for
    /// `keep_s` are gone, but for those whose time is not known. Returns whether anything changed. Throws InvalidInput
    /// for a time that is not known where touches shall fade, and for a patch that is full.
    bool pass(const Eigen::Vector3d& position, double seconds, const Gathering& gathering);

    /// Adds touches whose ids are the points' names, or moves those that have them. Throws InvalidInput for two of one
    /// name or without one, and for a patch that is full.
    void put(const NamedPoints& points, double seconds);

    /// Withdraws what was touched under this id. Throws InvalidInput where nothing was.
    void withdraw(const std::string& id);
    void clear() { touches_.clear(); }

    [[nodiscard]] bool empty() const { return touches_.empty(); }
    [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(touches_.size()); }
    [[nodiscard]] Eigen::Matrix3Xd points() const;  ///< 3 × P, LPS mm, in the order of touching

private:
    struct Touch {
        std::string id;
        Eigen::Vector3d position;
        double seconds;
    };
    void require_room(std::size_t more) const;

    std::vector<Touch> touches_;
};

}  // namespace tissuewarp::server
