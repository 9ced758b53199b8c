#pragma once
/// From segmented images to conditions on the mesh: where does each interface node belong in the fixed label map?

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <Eigen/Geometry>

#include <map>
#include <memory>
#include <vector>

namespace tissuewarp::registration {

/// A node of the mesh on the interface between two labels. A node where several interfaces meet occurs once for each.
struct InterfaceNode {
    int node = -1;
    int inner = 0, outer = 0;                          ///< labels; 0 is the outside
    double area = 0;                                   ///< a third of the adjacent interface triangles, mm²
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, rest configuration, from inner to outer
    double offset = 0;  ///< mm along the normal from the node to the moving label boundary
};

/// Interface triangles of a mesh gathered at nodes, and recomputed normals for a deformed state.
class Interfaces {
public:
    explicit Interfaces(const meshing::TetMesh& mesh);
    [[nodiscard]] const std::vector<InterfaceNode>& nodes() const { return nodes_; }
    [[nodiscard]] std::vector<InterfaceNode>& nodes() { return nodes_; }
    /// Unit normals at other node positions (3 × mesh nodes), one column per interface node.
    [[nodiscard]] Eigen::Matrix3Xd normals(const Eigen::Matrix3Xd& positions) const;
    /// Positions in nodes() of those that two edges or fewer along the same interface lead to, without the node itself.
    [[nodiscard]] std::vector<std::vector<int>> neighbours() const;
    /// Mean thickness of every label of the mesh that these are the interfaces of, mm: twice its volume over the area
    /// around it, which is the thickness of a plate and 2/3 of a ball's radius.
    [[nodiscard]] std::map<int, double> thickness(const meshing::TetMesh& mesh) const;

private:
    std::vector<InterfaceNode> nodes_;
    std::vector<std::array<int, 3>> faces_;         // mesh nodes
    std::vector<std::array<int, 3>> face_entries_;  // positions in nodes_
};

/// Smoothed label indicators of an image, sampled anywhere: a sub-voxel boundary from voxel labels.
class LabelBoundaryField {
public:
    /// Smooths each label of `thickness_mm` (Interfaces::thickness) by a Gaussian of one voxel, which takes the steps
    /// off its boundary, or of a quarter of its thickness, where that is less, but half a voxel at least: a plate
    /// thinner than 1.35 standard deviations is nowhere half there, and has no boundary left. Throws InvalidInput for
    /// an empty map.
    LabelBoundaryField(const imaging::Volume& label_map, const std::map<int, double>& thickness_mm);
    ~LabelBoundaryField();
    LabelBoundaryField(LabelBoundaryField&&) noexcept;
    LabelBoundaryField& operator=(LabelBoundaryField&&) noexcept;

    /// Signed distance (mm) along `normal` from `point` to the nearest crossing from `inner` to `outer` within ± range;
    /// NaN when there is none whose own normal lies within `max_angle_deg` of `normal`. Points and normal in LPS.
    [[nodiscard]] double crossing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner, int outer,
                                  double range_mm, double max_angle_deg) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::registration
