/// Sets of nodes, faces and tetrahedra, and meshes opened along interfaces.

#include "simulation/region.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "meshing/quality.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <set>

namespace tissuewarp::simulation {
namespace {

using Eigen::Vector3d;

/// Cells of 10 mm, label 1 where z < 20 mm, 2 above.
meshing::TetMesh two_layers() {
    meshing::TetMesh mesh = meshing::box_mesh({30, 30, 40}, {3, 3, 4});
    for (int e = 0; e < mesh.tet_count(); ++e) mesh.labels[e] = mesh.nodes(2, mesh.tets.col(e)).mean() < 20 ? 1 : 2;
    return mesh;
}

TEST(Regions, HoldTheNodesThatFulfilEveryCondition) {
    const tled::TissueMesh tissue = tled::closed(two_layers());
    Regions regions;
    regions["below"].side = Side{2, false, 0.0};
    regions["deep below"].side = Side{2, false, 10.5};
    regions["lower"].label = 1;
    regions["between"].interface = {1, 2};
    regions["ball"].ball = Ball{{0, 0, 0}, 10.5};
    regions["left"].half_space = HalfSpace{{5, 0, 0}, {1, 0, 0}};
    regions["left below"] = regions["left"];
    regions["left below"].side = Side{2, false, 0.0};
    regions["outside"].surface_of = 0;
    regions["inside"].without = {"outside"};
    const RegionFinder finder(tissue, regions);
    EXPECT_EQ(finder.nodes("below").size(), 16u);
    EXPECT_EQ(finder.nodes("deep below").size(), 32u);
    EXPECT_EQ(finder.nodes("lower").size(), 48u);
    EXPECT_EQ(finder.nodes("between").size(), 16u);
    EXPECT_EQ(finder.nodes("ball").size(), 4u) << "the corner and its neighbours along the axes";
    EXPECT_EQ(finder.nodes("left").size(), 20u);
    EXPECT_EQ(finder.nodes("left below").size(), 4u);
    EXPECT_EQ(finder.nodes("outside").size(), 4u * 4 * 5 - 2 * 2 * 3);
    EXPECT_EQ(finder.nodes("inside").size(), 2u * 2 * 3);
    for (const int node : finder.nodes("between")) EXPECT_EQ(tissue.mesh.nodes(2, node), 20);
}

/// Sum of area normals: the outward normal of a flat side times its area, zero for a closed surface.
Vector3d area_normal(const meshing::TetMesh& mesh, const Eigen::Matrix3Xi& faces) {
    Vector3d sum = Vector3d::Zero();
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
        const Vector3d a = mesh.nodes.col(faces(0, f)), b = mesh.nodes.col(faces(1, f)),
                       c = mesh.nodes.col(faces(2, f));
        sum += (b - a).cross(c - a) / 2;
    }
    return sum;
}

TEST(Regions, FacesLookOutward) {
    const tled::TissueMesh tissue = tled::closed(two_layers());
    Regions regions;
    regions["below"].side = Side{2, false, 0.0};
    regions["up"].interface = {1, 2};
    regions["down"].interface = {2, 1};
    regions["lower"].surface_of = 1;
    const RegionFinder finder(tissue, regions);
    const auto sum = [&](const char* name) { return area_normal(tissue.mesh, finder.faces(name)); };
    EXPECT_TRUE(sum("below").isApprox(Vector3d(0, 0, -900)));
    EXPECT_TRUE(sum("up").isApprox(Vector3d(0, 0, 900))) << "out of label 1";
    EXPECT_TRUE(sum("down").isApprox(Vector3d(0, 0, -900))) << "out of label 2";
    EXPECT_LT(sum("lower").norm(), 1e-9) << "closed";
    EXPECT_EQ(finder.faces("lower").cols(), 2 * (9 + 9 + 4 * 6));
    EXPECT_NEAR(nodal_areas(tissue.mesh, finder.faces("up")).sum(), 900, 1e-9);
}

TEST(Regions, TetrahedraGoByTheirCentroids) {
    const tled::TissueMesh tissue = tled::closed(two_layers());
    Regions regions;
    regions["upper"].label = 2;
    regions["cell"].box = Box{{0, 0, 0}, {10, 10, 10}};
    regions["rest"].without = {"upper", "cell"};
    const RegionFinder finder(tissue, regions);
    EXPECT_EQ(finder.tets("upper").size(), 6u * 18);
    EXPECT_EQ(finder.tets("cell").size(), 6u);
    EXPECT_EQ(finder.tets("rest").size(), 6u * (18 - 1));
}

TEST(Regions, RefuseWhatHoldsNothing) {
    const tled::TissueMesh tissue = tled::closed(two_layers());
    Regions regions;
    regions["far"].ball = Ball{{500, 0, 0}, 1};
    regions["self"].without = {"other"};
    regions["other"].without = {"self"};
    regions["between"].interface = {1, 2};
    regions["point"].ball = Ball{{0, 0, 0}, 1};
    const RegionFinder finder(tissue, regions);
    EXPECT_THROW((void)finder.nodes("far"), InvalidInput);
    EXPECT_THROW((void)finder.faces("far"), InvalidInput);
    EXPECT_THROW((void)finder.faces("point"), InvalidInput) << "one node is no face";
    EXPECT_THROW((void)finder.tets("far"), InvalidInput);
    EXPECT_THROW((void)finder.nodes("self"), InvalidInput);
    EXPECT_THROW((void)finder.tets("self"), InvalidInput);
    EXPECT_THROW((void)finder.tets("between"), InvalidInput) << "a surface has no tetrahedra";
    EXPECT_THROW((void)finder.nodes("nowhere"), InvalidInput);
}

TEST(SlidingInterface, SplitsItsNodesAndNothingElse) {
    tled::TissueMesh tissue = tled::closed(two_layers());
    const meshing::TetMesh before = tissue.mesh;
    const auto pairs = tled::open_interface(tissue, tled::sides_of_labels(tissue, {1, 2}), {}, 3.0);
    EXPECT_EQ(pairs.size(), 16u);
    EXPECT_EQ(tissue.mesh.node_count(), before.node_count() + 16);
    EXPECT_EQ(meshing::quality(before).components, 1);
    EXPECT_EQ(meshing::quality(tissue.mesh).components, 2) << "nothing joins the layers but the pairs";
    EXPECT_TRUE(meshing::tet_volumes(tissue.mesh).isApprox(meshing::tet_volumes(before)));
    double stiffness = 0;
    std::set<int> seen;
    for (const tled::SlidingPair& pair : pairs) {
        EXPECT_EQ(tissue.mesh.nodes.col(pair.first), tissue.mesh.nodes.col(pair.second));
        EXPECT_TRUE(pair.normal.isApprox(Vector3d::UnitZ())) << "out of label 1";
        EXPECT_TRUE(seen.insert(pair.first).second && seen.insert(pair.second).second);
        stiffness += pair.stiffness;
    }
    EXPECT_NEAR(stiffness, 3.0 * 900, 1e-9) << "kPa/mm times mm²";
    for (int e = 0; e < tissue.mesh.tet_count(); ++e)
        for (int c = 0; c < 4; ++c)
            EXPECT_TRUE(tissue.mesh.labels[e] == 2 || tissue.mesh.tets(c, e) == before.tets(c, e))
                << "the first label keeps its nodes";
}

TEST(SlidingInterface, StaysJoinedWhereAThirdLabelTouchesAndWhereToldSo) {
    meshing::TetMesh mesh = two_layers();
    for (int e = 0; e < mesh.tet_count(); ++e)
        if (mesh.nodes(0, mesh.tets.col(e)).mean() > 20) mesh.labels[e] = 3;  // a wall across both layers
    tled::TissueMesh tissue = tled::closed(mesh);
    tled::TissueMesh told = tissue;
    EXPECT_EQ(tled::open_interface(tissue, tled::sides_of_labels(tissue, {1, 2}), {}, 1.0).size(), 8u)
        << "4 of 12 nodes lie on the wall";
    EXPECT_EQ(meshing::quality(tissue.mesh).components, 1) << "the wall joins them";
    Regions regions;
    regions["front"].side = Side{1, false, 0.0};
    const std::vector<int> joined = RegionFinder(told, regions).nodes("front");
    EXPECT_EQ(tled::open_interface(told, tled::sides_of_labels(told, {1, 2}), joined, 1.0).size(), 6u);
    EXPECT_THROW(tled::open_interface(told, tled::sides_of_labels(told, {1, 7}), {}, 1.0), InvalidInput);
    tled::TissueMesh all = tled::closed(two_layers());
    const std::vector<int> everything = RegionFinder(all, {{"all", Region{}}}).nodes("all");
    EXPECT_THROW(tled::open_interface(all, tled::sides_of_labels(all, {1, 2}), everything, 1.0), InvalidInput);
}

// A cut within one label: the sides are sets of its tissue.
TEST(SlidingInterface, OpensWithinOneLabelBetweenSets) {
    meshing::TetMesh mesh = two_layers();
    mesh.labels.setOnes();
    const auto sides = [&](const tled::TissueMesh& tissue, double lower, double upper) {
        Regions halves;
        halves["first"].half_space = HalfSpace{{0, 0, lower}, {0, 0, 1}};
        halves["second"].half_space = HalfSpace{{0, 0, upper}, {0, 0, -1}};
        const RegionFinder finder(tissue, halves);
        return tled::InterfaceSides{finder.tets("first"), finder.tets("second"), "the sets 'first' and 'second'"};
    };
    const double middle = 0.5 * (mesh.nodes.row(2).minCoeff() + mesh.nodes.row(2).maxCoeff());
    tled::TissueMesh tissue = tled::closed(mesh);
    const auto pairs = tled::open_interface(tissue, sides(tissue, middle, middle), {}, 3.0);
    EXPECT_EQ(pairs.size(), 16u);
    EXPECT_EQ(meshing::quality(tissue.mesh).components, 2);
    for (const tled::SlidingPair& pair : pairs) EXPECT_TRUE(pair.normal.isApprox(Vector3d::UnitZ())) << "out of first";
    Regions regions;
    regions["label"].label = 1;
    EXPECT_EQ(RegionFinder(tissue, regions).nodes("label").size(), static_cast<std::size_t>(tissue.mesh.node_count()))
        << "both sides are of the label";
    EXPECT_EQ(RegionFinder(tissue, {}).outer_faces().cols(), 2 * (2 * 9 + 4 * 12)) << "the cut is no outer surface";
    // Tissue on neither side holds the rim of a cut that ends within the tissue.
    tled::TissueMesh cut = tled::closed(mesh);
    tled::InterfaceSides front = sides(cut, middle, middle);
    const auto behind = [&](int e) { return mesh.nodes(1, mesh.tets.col(e)).mean() > 10; };
    std::erase_if(front.first, behind);
    std::erase_if(front.second, behind);
    EXPECT_EQ(tled::open_interface(cut, front, {}, 3.0).size(), 4u)
        << "of a row of cells, whose inner row of nodes stays";
    EXPECT_EQ(meshing::quality(cut.mesh).components, 1);
    tled::TissueMesh none = tled::closed(mesh);
    const double high = mesh.nodes.row(2).maxCoeff();
    EXPECT_THROW(tled::open_interface(none, sides(none, high, middle), {}, 1.0), InvalidInput)
        << "they share tetrahedra";
}

TEST(SlidingInterface, RegionsFollowBothSides) {
    tled::TissueMesh tissue = tled::closed(two_layers());
    tled::open_interface(tissue, tled::sides_of_labels(tissue, {1, 2}), {}, 1.0);
    Regions regions;
    regions["between"].interface = {1, 2};
    regions["upper"].label = 2;
    regions["upper's surface"].surface_of = 2;
    regions["everything"] = {};
    const RegionFinder finder(tissue, regions);
    EXPECT_EQ(finder.nodes("between").size(), 32u);
    EXPECT_EQ(finder.nodes("upper").size(), 48u) << "copies, not the nodes that label 1 keeps";
    EXPECT_EQ(finder.nodes("everything").size(), 80u + 16);
    EXPECT_EQ(finder.outer_faces().cols(), 2 * (2 * 9 + 4 * 12)) << "the interface is no outer surface";
    const std::vector<int> upper = finder.nodes("upper");
    const Eigen::Matrix3Xi surface = finder.faces("upper's surface");
    for (const int node : surface.reshaped()) EXPECT_TRUE(std::binary_search(upper.begin(), upper.end(), node));
}

}  // namespace
}  // namespace tissuewarp::simulation
