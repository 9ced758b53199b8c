#pragma once
/// Parts of the tissue by where they are at rest and what they are made of.

#include "tled/tissue_mesh.hpp"

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::simulation {

/// Lengths mm, LPS.
struct Box {
    Eigen::Vector3d lower = Eigen::Vector3d::Zero(), upper = Eigen::Vector3d::Zero();
};
struct Ball {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double radius = 0.0;
};
/// Points x with (x − point)·normal ≤ 0.
struct HalfSpace {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit vector
};
/// The layer of this depth at one end of the mesh's bounding box.
struct Side {
    int axis = 0;           ///< 0, 1, 2
    bool upper = false;     ///< at the largest coordinate, not the smallest
    double depth_mm = 0.0;  ///< 0: a thousandth of the box's diagonal
};

/// What fulfils every condition that is given, less the regions named in `without`.
struct Region {
    std::optional<int> label;                     ///< tissue of this label
    std::optional<int> surface_of;                ///< boundary of this label to all others and the outside; 0: outside
    std::optional<std::array<int, 2>> interface;  ///< faces between two labels
    std::optional<Box> box;
    std::optional<Ball> ball;
    std::optional<HalfSpace> half_space;
    std::optional<Side> side;
    std::vector<std::string> without;
};

using Regions = std::map<std::string, Region>;

/// The regions of tissue at rest. Throws InvalidInput, with the region's name, for one that does not exist, is left out
/// of itself, or holds nothing of what is asked for.
class RegionFinder {
public:
    /// Holds references.
    RegionFinder(const tled::TissueMesh& tissue, const Regions& regions);

    /// Nodes, ascending; at a sliding interface those of both sides, unless the region names one label.
    [[nodiscard]] std::vector<int> nodes(const std::string& name) const;
    /// Faces of the outer surface, or of the surface or interface that the region names, all corners of which lie in
    /// the region; right-hand normals outward, of an interface out of the label named first, on whose side they are.
    /// 3 × F.
    [[nodiscard]] Eigen::Matrix3Xi faces(const std::string& name) const;
    /// All faces of the outer surface.
    [[nodiscard]] Eigen::Matrix3Xi outer_faces() const;
    /// Tetrahedra whose centroid lies in the region, ascending. Regions on surfaces have none.
    [[nodiscard]] std::vector<int> tets(const std::string& name) const;

private:
    [[nodiscard]] const Region& region(const std::string& name) const;
    [[nodiscard]] std::vector<bool> holds_node(const std::string& name, int depth) const;
    [[nodiscard]] bool contains(const Region& region, const Eigen::Vector3d& point) const;

    const tled::TissueMesh& tissue_;
    const Regions& regions_;
    Eigen::Vector3d lower_, upper_;
};

/// A third of the area of its faces at each node, mm²; by node of the mesh.
Eigen::VectorXd nodal_areas(const meshing::TetMesh& mesh, const Eigen::Matrix3Xi& faces);

}  // namespace tissuewarp::simulation
