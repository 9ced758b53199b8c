#include "registration/boundary/label_surface.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"

#include <Eigen/Geometry>

#include <array>
#include <unordered_map>
#include <utility>
#include <vector>

namespace tissuewarp::registration {

namespace {

using imaging::Volume;
using Index = Eigen::Vector3i;

/// Smoothed indicator of the organ, in voxels along each axis whatever the spacing.
Volume smoothed_indicator(const Volume& labels) {
    Volume indicator = imaging::mask_of_all(labels).as(CV_32F);
    indicator.geometry.spacing.setOnes();
    Volume smoothed = imaging::smooth(indicator, LabelSurfaceOptions().smoothing_voxels);
    smoothed.geometry = labels.geometry;
    return smoothed;
}

/// Nodes in cells of eight voxels, quadrilaterals around the grid's edges that the level crosses.
class SurfaceNets {
public:
    explicit SurfaceNets(const Volume& indicator) : indicator_(indicator), values_(indicator_.data<float>()) {
        const auto& size = indicator_.geometry.size;
        last_ = Index(size[0], size[1], size[2]).array() - 1;
        Index voxel;
        for (voxel[2] = 0; voxel[2] <= last_[2]; ++voxel[2])
            for (voxel[1] = 0; voxel[1] <= last_[1]; ++voxel[1])
                for (voxel[0] = 0; voxel[0] <= last_[0]; ++voxel[0])
                    for (int axis = 0; axis < 3; ++axis)
                        if (voxel[axis] < last_[axis]) visit_edge(voxel, axis);
    }

    [[nodiscard]] meshing::SurfaceMesh mesh() const {
        meshing::SurfaceMesh surface;
        surface.nodes.resize(3, static_cast<Eigen::Index>(nodes_.size()));
        surface.triangles.resize(3, static_cast<Eigen::Index>(triangles_.size()));
        for (std::size_t n = 0; n < nodes_.size(); ++n) surface.nodes.col(static_cast<Eigen::Index>(n)) = nodes_[n];
        for (std::size_t t = 0; t < triangles_.size(); ++t)
            surface.triangles.col(static_cast<Eigen::Index>(t)) = triangles_[t];
        return surface;
    }

private:
    static constexpr float level = 0.5F;

    Volume indicator_;
    const float* values_;
    Index last_;
    std::unordered_map<std::int64_t, int> node_of_cell_;  // by the offset of its lowest voxel
    std::vector<Eigen::Vector3d> nodes_;
    std::vector<Eigen::Vector3i> triangles_;

    [[nodiscard]] float value(const Index& v) const { return values_[indicator_.offset(v[0], v[1], v[2])]; }

    void visit_edge(const Index& voxel, int axis) {
        const Index next = voxel + Index::Unit(axis);
        const bool here_inside = value(voxel) > level, there_inside = value(next) > level;
        if (here_inside == there_inside) return;
        const Index b = Index::Unit((axis + 1) % 3), c = Index::Unit((axis + 2) % 3);
        const std::array<Index, 4> cells{voxel, voxel - b, voxel - b - c, voxel - c};
        std::array<int, 4> quad{};
        for (std::size_t n = 0; n < 4; ++n) {
            if (cells[n].minCoeff() < 0 || (cells[n].array() >= last_.array()).any()) return;  // the image's border
            quad[n] = node_of(cells[n]);
        }
        const Eigen::Vector3d along = indicator_.geometry.direction.col(axis) * (here_inside ? 1 : -1);
        const auto corner = [&](std::size_t n) { return nodes_[static_cast<std::size_t>(quad[n])]; };
        const Eigen::Vector3d normal = (corner(2) - corner(0)).cross(corner(3) - corner(1));
        if (normal.dot(along) < 0) std::swap(quad[1], quad[3]);
        triangles_.emplace_back(quad[0], quad[1], quad[2]);
        triangles_.emplace_back(quad[0], quad[2], quad[3]);
    }

    int node_of(const Index& cell) {
        const auto [entry, is_new] =
            node_of_cell_.try_emplace(indicator_.offset(cell[0], cell[1], cell[2]), static_cast<int>(nodes_.size()));
        if (is_new) nodes_.push_back(indicator_.geometry.point(mean_crossing(cell)));
        return entry->second;
    }

    /// Continuous index of the mean of the crossings on the cell's twelve edges.
    [[nodiscard]] Eigen::Vector3d mean_crossing(const Index& cell) const {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        int crossings = 0;
        for (int axis = 0; axis < 3; ++axis)
            for (int edge = 0; edge < 4; ++edge) {
                const Index from =
                    cell + (edge & 1) * Index::Unit((axis + 1) % 3) + (edge >> 1 & 1) * Index::Unit((axis + 2) % 3);
                const float a = value(from), b = value(from + Index::Unit(axis));
                if ((a > level) == (b > level)) continue;
                sum += from.cast<double>() + double((a - level) / (a - b)) * Eigen::Vector3d::Unit(axis);
                ++crossings;
            }
        return sum / crossings;
    }
};

}  // namespace

meshing::SurfaceMesh label_surface(const Volume& labels) {
    meshing::SurfaceMesh surface = SurfaceNets(smoothed_indicator(labels)).mesh();
    if (surface.triangle_count() == 0)
        throw InvalidInput(
            "the label map shows no surface of the organ: it is empty, full, or nowhere two voxels thick");
    return surface;
}

}  // namespace tissuewarp::registration
