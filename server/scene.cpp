#include "server/scene.hpp"

#include "imaging/labels.hpp"

#include <algorithm>
#include <cctype>

namespace tissuewarp::server {

namespace {

constexpr const char* names_text =
    "moving_points, fixed_points, targets, touched (POINT), fixed_surface, moving_curves, fixed_curves (POLYDATA), "
    "fixed, fixed_2 to fixed_9, fixed_labels (IMAGE), start and a stylus that was named to gather (TRANSFORM)";

[[noreturn]] void refuse(const std::string& name, const char* kind) {
    throw InvalidInput("no " + std::string(kind) + " is called '" + name + "'; names are " + names_text);
}

bool is_contrast(const std::string& name) {
    return name.size() == 7 && name.starts_with("fixed_") && name[6] >= '2' && name[6] <= '9';
}

Eigen::Matrix3Xd polyline(const PolyData& mesh, const std::vector<int>& line) {
    Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(line.size()));
    for (std::size_t k = 0; k < line.size(); ++k) points.col(static_cast<Eigen::Index>(k)) = mesh.points.col(line[k]);
    return points;
}

}  // namespace

std::string plain_name(const std::string& device) {
    std::string name = device;
    for (char& c : name) {
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
        if (c == ' ' || c == '-' || c == '.') c = '_';
    }
    return name;
}

void Scene::take_points(const std::string& name, const NamedPoints& points, double seconds) {
    if (name == "moving_points")
        moving_points_ = points;
    else if (name == "fixed_points")
        fixed_points_ = points;
    else if (name == "targets")
        targets_ = points;
    else if (name == "touched" && points.empty())
        touched_.clear();
    else if (name == "touched")
        touched_.put(points, seconds);
    else
        refuse(name, "POINT");
}

void Scene::take_mesh(const std::string& name, const PolyData& mesh) {
    std::optional<PolyData> given;
    if (mesh.points.cols() > 0) given = mesh;
    if (name == "fixed_surface")
        surface_ = given;
    else if (name == "moving_curves")
        moving_curves_ = given;
    else if (name == "fixed_curves")
        fixed_curves_ = given;
    else
        refuse(name, "POLYDATA");
}

void Scene::take_image(const std::string& name, const imaging::Volume& image) {
    if (name == "fixed_labels") {
        if (image.voxels.depth() >= CV_32F) throw InvalidInput("fixed_labels holds fractions; send whole numbers");
        const imaging::Volume labels = image.as(CV_32S);
        imaging::require_labels(labels, {}, "fixed_labels");
        images_[name] = labels;
        return;
    }
    if (name != "fixed" && !is_contrast(name)) refuse(name, "IMAGE");
    images_[name] = image;
}

void Scene::gather(const Gathering& gathering) {
    if (gathering.device == "start") throw InvalidInput("'start' is where the organ lies; a stylus has another name");
    gathering_ = gathering;
}

bool Scene::take_transform(const std::string& name, const Eigen::Isometry3d& transform, double seconds) {
    if (name == gathering_.device) return touched_.pass(transform.translation(), seconds, gathering_);
    if (name != "start") refuse(name, "TRANSFORM");
    start_ = transform;
    return true;
}

void Scene::take(const std::string& device, const Message& message, double seconds) {
    const std::string name = plain_name(device);
    if (const auto* points = std::get_if<NamedPoints>(&message))
        take_points(name, *points, seconds);
    else if (const auto* mesh = std::get_if<PolyData>(&message))
        take_mesh(name, *mesh);
    else if (const auto* image = std::get_if<imaging::Volume>(&message))
        take_image(name, *image);
    else if (const auto* transform = std::get_if<Eigen::Isometry3d>(&message)) {
        if (!take_transform(name, *transform, seconds)) return;
    } else
        return;
    ++state_;
}

void Scene::forget(const std::string& device) {
    const std::string name = plain_name(device);
    if (name == "start")
        start_.reset();
    else if (name == "fixed" || name == "fixed_labels" || is_contrast(name))
        images_.erase(name);
    else if (name.ends_with("points") || name == "targets" || name == "touched")
        take_points(name, {}, 0);
    else
        take_mesh(name, {});
    ++state_;
}

void Scene::forget_touched(const std::vector<std::string>& ids) {
    TouchedPatch left = touched_;
    for (const std::string& id : ids) left.withdraw(id);
    touched_ = std::move(left);
    ++state_;
}

std::vector<std::string> Scene::data() const {
    std::vector<std::string> names;
    for (const auto& [name, image] : images_) names.push_back(name);
    if (surface_) names.emplace_back("fixed_surface");
    if (!touched_.empty()) names.emplace_back("touched");
    if (!fixed_points_.empty()) names.emplace_back("fixed_points");
    if (fixed_curves_) names.emplace_back("fixed_curves");
    return names;
}

const imaging::Geometry* Scene::grid() const {
    for (const char* name : {"fixed", "fixed_labels"})
        if (const auto found = images_.find(name); found != images_.end()) return &found->second.geometry;
    return nullptr;
}

registration::PointPairs Scene::pairs() const {
    std::map<std::string, Eigen::Vector3d> moving;
    for (const NamedPoint& point : moving_points_)
        if (!moving.emplace(point.name, point.position).second)
            throw InvalidInput("two of moving_points are called '" + point.name + "'; pairs are told by names");
    std::map<std::string, std::pair<Eigen::Vector3d, Eigen::Vector3d>> pairs;
    for (const NamedPoint& point : fixed_points_) {
        const auto partner = moving.find(point.name);
        if (partner == moving.end()) continue;
        if (!pairs.emplace(point.name, std::pair{partner->second, point.position}).second)
            throw InvalidInput("two of fixed_points are called '" + point.name + "'; pairs are told by names");
    }
    if (pairs.empty()) throw InvalidInput("moving_points and fixed_points share no name; pairs are told by names");
    registration::PointPairs result;
    result.moving.resize(3, static_cast<Eigen::Index>(pairs.size()));
    result.fixed.resize(3, result.moving.cols());
    Eigen::Index column = 0;
    for (const auto& [name, pair] : pairs) {
        result.moving.col(column) = pair.first;
        result.fixed.col(column++) = pair.second;
    }
    return result;
}

/// What was touched has no normals, and then the whole surface has none.
registration::SurfacePoints Scene::surface(bool patch, bool touched) const {
    if (!touched) return {surface_->points, surface_->normals};
    registration::SurfacePoints all;
    all.points = touched_.points();
    all.normals.resize(3, 0);
    if (!patch) return all;
    const Eigen::Matrix3Xd alone = std::move(all.points);
    all.points.resize(3, surface_->points.cols() + alone.cols());
    all.points << surface_->points, alone;
    return all;
}

registration::Intraoperative Scene::seen(const std::vector<std::string>& use, const Deviations& deviations) const {
    const std::vector<std::string> there = data();
    for (const std::string& name : use)
        if (std::find(there.begin(), there.end(), name) == there.end())
            throw InvalidInput("'" + name + "' was not sent, or is nothing to register to");
    const auto wanted = [&](const std::string& name) {
        const auto& names = use.empty() ? there : use;
        return std::find(names.begin(), names.end(), name) != names.end();
    };
    registration::Intraoperative seen;
    seen.start = start_;
    for (const auto& [name, image] : images_) {
        if (!wanted(name)) continue;
        if (name == "fixed_labels")
            seen.labels = image;
        else if (name == "fixed")
            seen.image = image;
        else
            seen.contrasts.push_back(image);
    }
    if (wanted("fixed_surface") || wanted("touched")) {
        seen.surface = surface(wanted("fixed_surface"), wanted("touched"));
        seen.surface->deviation_mm = deviations.surface_mm;
    }
    if (wanted("fixed_points")) {
        seen.points = pairs();
        seen.points->deviation_mm = deviations.points_mm;
    }
    if (wanted("fixed_curves")) {
        if (!moving_curves_) throw InvalidInput("fixed_curves is there and moving_curves is not; send both");
        registration::Curves curves;
        for (const std::vector<int>& line : moving_curves_->lines)
            curves.moving.push_back(polyline(*moving_curves_, line));
        curves.fixed = fixed_curves_->points;
        curves.tangents.resize(3, 0);
        curves.deviation_mm = deviations.curves_mm;
        seen.curves = std::move(curves);
    }
    return seen;
}

}  // namespace tissuewarp::server
