#include "imaging/detail/frame_transforms.hpp"

#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/text_headers.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <deque>

namespace tissuewarp::imaging::detail {

namespace {

constexpr std::string_view frame_prefix = "Seq_Frame", transform_suffix = "Transform", status_suffix = "Status";

bool is_ok(const std::string& status) {
    return lower_case(status) == "ok";
}

/// The number of the frame and the name of the field, of "Seq_Frame0012_Name".
std::optional<std::pair<int, std::string>> frame_field(const std::string& key) {
    if (!key.starts_with(frame_prefix)) return std::nullopt;
    constexpr std::size_t most_digits = 9;
    const std::size_t digits = frame_prefix.size(), end = key.find('_', digits);
    if (end == std::string::npos || end == digits || end - digits > most_digits) return std::nullopt;
    int number = 0;
    for (std::size_t n = digits; n < end; ++n) {
        if (!std::isdigit(static_cast<unsigned char>(key[n]))) return std::nullopt;
        number = 10 * number + (key[n] - '0');
    }
    return std::pair(number, key.substr(end + 1));
}

}  // namespace

Eigen::Affine3d affine_of(const std::filesystem::path& path, const std::string& what, const std::string& text) {
    const std::vector<double> numbers = numbers_in(text);
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
    if (numbers.size() == 16) matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
    if (matrix.topRows<3>().col(2).isZero(0)) {
        const Eigen::Vector3d across = matrix.topRows<3>().col(0), along = matrix.topRows<3>().col(1);
        matrix.topRows<3>().col(2) = across.cross(along) / std::sqrt(std::max(across.norm() * along.norm(), 1e-30));
    }
    if (!matrix.allFinite() || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1) ||
        std::abs(matrix.topLeftCorner<3, 3>().determinant()) < 1e-12)
        throw unreadable(path, "its " + shortened(what) + " is '" + shortened(text) +
                                   "', no 16 numbers of an affine transform that can be inverted; correct it");
    return Eigen::Affine3d(matrix);
}

bool FrameTransforms::add(const std::string& from, const std::string& to, const Eigen::Affine3d& transform) {
    constexpr double most_off = 1e-3;  // files have six digits
    if (const auto way = ways_.find(from); way != ways_.end())
        if (const auto known = way->second.find(to); known != way->second.end())
            return known->second.isApprox(transform, most_off);
    ways_[from].emplace(to, transform);
    ways_[to].emplace(from, transform.inverse());
    return true;
}

std::optional<Eigen::Affine3d> FrameTransforms::between(const std::string& from, const std::string& to) const {
    std::map<std::string, Eigen::Affine3d> reached{{from, Eigen::Affine3d::Identity()}};
    for (std::deque<std::string> open{from}; !open.empty(); open.pop_front()) {
        const std::string& here = open.front();
        if (here == to) return reached.at(to);
        const auto ways = ways_.find(here);
        if (ways == ways_.end()) continue;
        for (const auto& [next, transform] : ways->second)
            if (reached.try_emplace(next, transform * reached.at(here)).second) open.push_back(next);
    }
    return std::nullopt;
}

std::set<std::string> FrameTransforms::systems() const {
    std::set<std::string> names;
    for (const auto& [name, ways] : ways_) names.insert(name);
    return names;
}

std::optional<std::pair<std::string, std::string>> systems_of(const std::string& name) {
    for (std::size_t at = name.find("To", 1); at != std::string::npos; at = name.find("To", at + 1))
        if (at + 2 < name.size() && std::isupper(static_cast<unsigned char>(name[at + 2])))
            return std::pair(name.substr(0, at), name.substr(at + 2));
    return std::nullopt;
}

std::map<int, FrameFields> frame_fields(const std::filesystem::path& path,
                                        const std::map<std::string, std::string>& fields, int count) {
    std::map<int, FrameFields> frames;
    for (const auto& [key, value] : fields) {
        const auto field = frame_field(key);
        if (!field) continue;
        const auto& [number, name] = *field;
        if (number >= count)
            throw unreadable(path, "its '" + shortened(key) + "' is of a frame that it does not have; its frames are " +
                                       std::to_string(count));
        FrameFields& frame = frames[number];
        if (name == "ImageStatus") frame.image_ok = is_ok(value);
        if (!name.ends_with(transform_suffix)) continue;
        const auto systems = systems_of(name.substr(0, name.size() - transform_suffix.size()));
        if (!systems) continue;
        const auto status = fields.find(key + std::string(status_suffix));
        if (status != fields.end() && !is_ok(status->second)) continue;
        if (!frame.transforms.add(systems->first, systems->second, affine_of(path, "'" + key + "'", value)))
            throw unreadable(
                path, "its '" + shortened(key) + "' contradicts another transform between the same two; leave one");
    }
    return frames;
}

}  // namespace tissuewarp::imaging::detail
