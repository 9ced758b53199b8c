#include "registration/boundary/interfaces.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <tuple>

namespace tissuewarp::registration {

using imaging::Volume;

Interfaces::Interfaces(const meshing::TetMesh& mesh) {
    std::map<std::tuple<int, int, int>, int> index;  // (inner, outer, node) → entry
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh)) {
        std::array<int, 3> entries{};
        const Eigen::Vector3d a = mesh.nodes.col(face.nodes[0]), b = mesh.nodes.col(face.nodes[1]),
                              c = mesh.nodes.col(face.nodes[2]);
        const Eigen::Vector3d twice_area = (b - a).cross(c - a);
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const auto [entry, fresh] =
                index.try_emplace({face.inner, face.outer, face.nodes[corner]}, static_cast<int>(nodes_.size()));
            if (fresh)
                nodes_.push_back({face.nodes[corner], face.inner, face.outer, 0.0, Eigen::Vector3d::Zero(), 0.0});
            entries[corner] = entry->second;
            InterfaceNode& node = nodes_[static_cast<std::size_t>(entry->second)];
            node.area += twice_area.norm() / 6;
            node.normal += twice_area;
        }
        faces_.push_back(face.nodes);
        face_entries_.push_back(entries);
    }
    for (InterfaceNode& node : nodes_) node.normal.normalize();
}

Eigen::Matrix3Xd Interfaces::normals(const Eigen::Matrix3Xd& positions) const {
    Eigen::Matrix3Xd normals = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(nodes_.size()));
    for (std::size_t f = 0; f < faces_.size(); ++f) {
        const Eigen::Vector3d a = positions.col(faces_[f][0]), b = positions.col(faces_[f][1]),
                              c = positions.col(faces_[f][2]);
        const Eigen::Vector3d twice_area = (b - a).cross(c - a);
        for (const int entry : face_entries_[f]) normals.col(entry) += twice_area;
    }
    normals.colwise().normalize();
    return normals;
}

std::vector<std::vector<int>> Interfaces::neighbours() const {
    std::vector<std::set<int>> adjacent(nodes_.size());
    for (const std::array<int, 3>& entries : face_entries_)
        for (const int entry : entries)
            adjacent[static_cast<std::size_t>(entry)].insert(entries.begin(), entries.end());
    std::vector<std::vector<int>> result;
    for (std::size_t entry = 0; entry < adjacent.size(); ++entry) {
        std::set<int> near;
        for (const int next : adjacent[entry]) {
            const std::set<int>& beyond = adjacent[static_cast<std::size_t>(next)];
            near.insert(beyond.begin(), beyond.end());
        }
        near.erase(static_cast<int>(entry));
        result.emplace_back(near.begin(), near.end());
    }
    return result;
}

std::map<int, double> Interfaces::thickness(const meshing::TetMesh& mesh) const {
    std::map<int, double> volume, area;
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    for (int t = 0; t < mesh.tet_count(); ++t) volume[mesh.labels[t]] += volumes[t];
    for (const InterfaceNode& node : nodes_) {
        area[node.inner] += node.area;
        area[node.outer] += node.area;
    }
    std::map<int, double> result;
    for (const auto& [label, of_label] : volume) result[label] = 2 * of_label / area.at(label);
    return result;
}

namespace {

constexpr double most_smoothing = 1.0, least_smoothing = 0.5;  // voxels
constexpr double smoothing_share = 0.25;                       // of a label's thickness

/// A smoothed indicator on the bounding box of its label: zero outside, which clamped sampling gives for nothing
/// because the box has a margin wider than the Gaussian.
struct Indicator {
    Volume volume;
    imaging::LinearSampler sampler;
    explicit Indicator(Volume smoothed) : volume(std::move(smoothed)), sampler(volume) {}
};

/// `smoothing` in voxels.
std::unique_ptr<Indicator> indicator(const Volume& mask, const imaging::LabelStatistics& box, double smoothing) {
    const int margin = static_cast<int>(std::ceil(4 * smoothing)) + 2;
    std::array<int, 3> lower{}, upper{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        lower[axis] = std::max(0, box.lower[axis] - margin);
        upper[axis] = std::min(mask.geometry.size[axis], box.upper[axis] + margin);
    }
    const Volume part = imaging::crop(mask, lower, upper);
    return std::make_unique<Indicator>(imaging::smooth(part, smoothing * part.geometry.spacing.minCoeff()));
}

}  // namespace

struct LabelBoundaryField::Impl {
    std::map<int, std::unique_ptr<Indicator>> of_label;
    std::unique_ptr<Indicator> of_all;
    double step = 0.5;  // mm

    [[nodiscard]] bool knows(int label) const { return label == 0 || of_label.contains(label); }

    [[nodiscard]] double presence(int label, const Eigen::Vector3d& point) const {
        if (label == 0) return 1 - double(of_all->sampler.value(point));
        return double(of_label.at(label)->sampler.value(point));
    }

    /// Positive in `inner`, negative in `outer`.
    [[nodiscard]] double side(const Eigen::Vector3d& point, int inner, int outer) const {
        return presence(inner, point) - presence(outer, point);
    }

    /// Both labels meet here and hardly anything else does, and the boundary faces along `normal`.
    [[nodiscard]] bool is_boundary(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner, int outer,
                                   double least_cosine) const {
        if (presence(inner, point) + presence(outer, point) < 0.6) return false;
        Eigen::Vector3d gradient;
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(axis);
            gradient[axis] = side(point + offset, inner, outer) - side(point - offset, inner, outer);
        }
        return -gradient.dot(normal) >= least_cosine * gradient.norm() && gradient.norm() > 0;
    }
};

LabelBoundaryField::LabelBoundaryField(const Volume& label_map, const std::map<int, double>& thickness_mm)
    : impl_(std::make_unique<Impl>()) {
    const Volume map = label_map.as(CV_32S);
    const double voxel_mm = map.geometry.spacing.minCoeff();
    const auto statistics = imaging::label_statistics(map);
    imaging::LabelStatistics everything;
    everything.lower = map.geometry.size;
    for (const auto& [label, box] : statistics) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            everything.lower[axis] = std::min(everything.lower[axis], box.lower[axis]);
            everything.upper[axis] = std::max(everything.upper[axis], box.upper[axis]);
        }
        const auto thickness = thickness_mm.find(label);
        if (thickness == thickness_mm.end()) continue;
        const double bearable = smoothing_share * thickness->second / voxel_mm;
        const double smoothing = std::clamp(bearable, least_smoothing, most_smoothing);
        impl_->of_label[label] = indicator(imaging::mask_of(map, label), box, smoothing);
    }
    if (statistics.empty()) throw InvalidInput("the label map is empty: there is no boundary to match");
    impl_->of_all = indicator(imaging::mask_of_all(map), everything, most_smoothing);
    impl_->step = 0.5 * voxel_mm;
}

LabelBoundaryField::~LabelBoundaryField() = default;
LabelBoundaryField::LabelBoundaryField(LabelBoundaryField&&) noexcept = default;
LabelBoundaryField& LabelBoundaryField::operator=(LabelBoundaryField&&) noexcept = default;

double LabelBoundaryField::crossing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner, int outer,
                                    double range_mm, double max_angle_deg) const {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    if (!impl_->knows(inner) || !impl_->knows(outer)) return none;
    const double step = impl_->step, least_cosine = std::cos(max_angle_deg * EIGEN_PI / 180);
    const int steps = static_cast<int>(std::ceil(range_mm / step));
    const auto side = [&](double s) { return impl_->side(point + s * normal, inner, outer); };

    // Walk both ways at once, so that the first crossing found is the nearest.
    double ahead = side(0), behind = ahead;
    for (int i = 1; i <= steps; ++i) {
        const double next_ahead = side(i * step), next_behind = side(-i * step);
        std::optional<double> nearest;
        if (ahead > 0 && next_ahead <= 0) nearest = step * (i - 1 + ahead / (ahead - next_ahead));
        if (behind <= 0 && next_behind > 0) {
            const double back = -step * (i - 1 + behind / (behind - next_behind));
            if (!nearest || -back < *nearest) nearest = back;
        }
        if (nearest && impl_->is_boundary(point + *nearest * normal, normal, inner, outer, least_cosine))
            return *nearest;
        ahead = next_ahead;
        behind = next_behind;
    }
    return none;
}

}  // namespace tissuewarp::registration
