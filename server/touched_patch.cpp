#include "server/touched_patch.hpp"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

namespace tissuewarp::server {

namespace {

constexpr std::size_t most_touches = 100'000;  // as of a POINT message
constexpr double still_s = 1;                  // a stylus at rest renews its touch so often

}  // namespace

void TouchedPatch::require_room(std::size_t more) const {
    if (touches_.size() + more > most_touches)
        throw InvalidInput(
            "the touched patch would hold more than 100 000 points; forget some, or gather with a wider "
            "spacing_mm");
}

bool TouchedPatch::pass(const Eigen::Vector3d& position, double seconds, const Gathering& gathering) {
    if (gathering.keep_s > 0 && seconds <= 0)
        throw InvalidInput("'" + gathering.device +
                           "' says no time, so that nothing can fade; send timestamps or gather without keep_s");
    const auto is_near = [&](const Touch& touch) {
        return (touch.position - position).squaredNorm() < gathering.spacing_mm * gathering.spacing_mm;
    };
    const auto is_young = [&](const Touch& touch) { return seconds < touch.seconds + still_s; };
    const auto says_it_already = [&](const Touch& touch) { return is_near(touch) && is_young(touch); };
    if (std::any_of(touches_.begin(), touches_.end(), says_it_already)) return false;
    const auto is_faded = [&](const Touch& touch) {
        return gathering.keep_s > 0 && touch.seconds > 0 && touch.seconds + gathering.keep_s < seconds;
    };
    std::erase_if(touches_, [&](const Touch& touch) { return is_near(touch) || is_faded(touch); });
    require_room(1);
    touches_.push_back({gathering.id, position, seconds});
    return true;
}

void TouchedPatch::put(const NamedPoints& points, double seconds) {
    std::unordered_set<std::string> names;
    for (const NamedPoint& point : points)
        if (point.name.empty() || !names.insert(point.name).second)
            throw InvalidInput("of touched every point needs a name of its own; '" + point.name + "' is none");
    std::unordered_map<std::string, std::size_t> there;
    for (std::size_t n = 0; n < touches_.size(); ++n) there.emplace(touches_[n].id, n);
    require_room(std::size_t(std::count_if(points.begin(), points.end(),
                                           [&](const NamedPoint& point) { return !there.contains(point.name); })));
    for (const NamedPoint& point : points) {
        const Touch touch{point.name, point.position, seconds};
        if (const auto same = there.find(point.name); same != there.end())
            touches_[same->second] = touch;
        else
            touches_.push_back(touch);
    }
}

void TouchedPatch::withdraw(const std::string& id) {
    if (std::erase_if(touches_, [&](const Touch& touch) { return touch.id == id; }) == 0)
        throw InvalidInput("nothing was touched as '" + id + "'");
}

Eigen::Matrix3Xd TouchedPatch::points() const {
    Eigen::Matrix3Xd points(3, size());
    for (Eigen::Index n = 0; n < size(); ++n) points.col(n) = touches_[static_cast<std::size_t>(n)].position;
    return points;
}

}  // namespace tissuewarp::server
