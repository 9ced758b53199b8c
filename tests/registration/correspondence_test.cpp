/// Sub-voxel boundaries from voxel labels, and interface nodes with their normals.
#include "registration/boundary/interfaces.hpp"
#include "registration/boundary/label_boundary_field.hpp"

#include "core/errors.hpp"

#include "meshing/primitives.hpp"
#include "registration/terms/label_matches.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration {
namespace {

using detail::Match;
using Eigen::Vector3d;

const shapes::Organ ball_organ{{0, 0, 0}, {40, 40, 40}, {0, 0, 0}, 15};
const std::map<int, double> thickness_mm{{1, 24}, {2, 10}};

TEST(LabelBoundaryField, CrossingOfABallIsSubVoxel) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ, Eigen::Isometry3d::Identity(), 1.0), thickness_mm);
    for (int i = 0; i < 50; ++i) {
        const Vector3d n = Vector3d(std::sin(1.0 + i), std::cos(2.3 * i), std::sin(0.7 * i)).normalized();
        EXPECT_NEAR(field.crossing(37 * n, n, 1, 0, 10, 45), 3.0, 0.35) << i;   // ahead
        EXPECT_NEAR(field.crossing(44 * n, n, 1, 0, 10, 45), -4.0, 0.35) << i;  // behind
        EXPECT_NEAR(field.crossing(17 * n, n, 2, 1, 10, 45), -2.0, 0.35) << i;  // inner interface
    }
}

TEST(LabelBoundaryField, NothingBeyondTheRange) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ), thickness_mm);
    EXPECT_TRUE(std::isnan(field.crossing({30, 0, 0}, {1, 0, 0}, 1, 0, 5, 45)));
}

TEST(LabelBoundaryField, ASurfaceFacingAwayIsNotMatched) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ), thickness_mm);
    EXPECT_TRUE(std::isnan(field.crossing({39, 0, 0}, {-1, 0, 0}, 1, 0, 6, 45)));  // normal reversed
    const Vector3d oblique = Vector3d(1, 2, 0).normalized();                       // 63° off
    EXPECT_TRUE(std::isnan(field.crossing(Vector3d(40, 0, 0) - oblique, oblique, 1, 0, 6, 45)));
}

TEST(LabelBoundaryField, UnknownLabelsHaveNoBoundary) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ), {{1, 24}});
    EXPECT_TRUE(std::isnan(field.crossing({15, 0, 0}, {1, 0, 0}, 2, 1, 6, 45)));
}

TEST(LabelBoundaryField, AnEmptyMapIsRefused) {
    auto labels = shapes::organ_labels(ball_organ);
    labels.voxels.setTo(0);
    EXPECT_THROW(LabelBoundaryField(labels, thickness_mm), InvalidInput);
}

/// Label 1 where |z| ≤ half of `thickness` voxels of 1 mm, within |x|, |y| ≤ 8.
imaging::Volume plate_labels(int thickness) {
    imaging::Geometry grid;
    grid.size = {31, 31, 31};
    grid.origin = {-15, -15, -15 + 0.5 * ((thickness + 1) % 2)};
    imaging::Volume labels(grid, CV_32SC1);
    labels.voxels.setTo(0);
    for (int k = 0; k < 31; ++k)
        for (int j = 0; j < 31; ++j)
            for (int i = 0; i < 31; ++i) {
                const Vector3d x = grid.point({double(i), double(j), double(k)});
                if (std::abs(x[0]) <= 8 && std::abs(x[1]) <= 8 && std::abs(x[2]) < 0.5 * thickness)
                    labels.data<std::int32_t>()[labels.offset(i, j, k)] = 1;
            }
    return labels;
}

// The outside is smoothed more, which draws the boundary of a single voxel inward, alike in both images; of two voxels
// it is found to a tenth of a voxel. Smoothed by a whole voxel a plate of one has no boundary at all.
TEST(LabelBoundaryField, AThinPlateKeepsItsBoundary) {
    for (const int thickness : {1, 2, 3}) {
        const LabelBoundaryField field(plate_labels(thickness), {{1, double(thickness)}});
        for (const double side : {-1.0, 1.0}) {
            const double found = field.crossing({0.3, -0.2, 0}, {0, 0, side}, 1, 0, 5, 45);
            EXPECT_NEAR(found, 0.5 * thickness, thickness == 1 ? 0.3 : 0.1) << thickness << " voxels, " << side;
        }
    }
}

TEST(Interfaces, ThicknessOfAPlateAndOfTwoBlocks) {
    const auto plate = meshing::box_mesh({200, 200, 2}, {20, 20, 1});
    EXPECT_NEAR(Interfaces(plate).thickness(plate).at(plate.labels[0]), 2, 0.05);

    auto blocks = meshing::box_mesh({20, 10, 10}, {4, 2, 2});
    for (int t = 0; t < blocks.tet_count(); ++t)
        blocks.labels[t] = blocks.nodes(0, blocks.tets.col(t)).mean() < 10 ? 1 : 2;
    for (const auto& [label, thickness] : Interfaces(blocks).thickness(blocks))
        EXPECT_NEAR(thickness, 10.0 / 3, 1e-9) << label;  // a cube of 10 mm
}

TEST(Interfaces, OfTwoBlocks) {
    auto mesh = meshing::box_mesh({20, 10, 10}, {4, 2, 2});
    for (int t = 0; t < mesh.tet_count(); ++t) {
        double x = 0;
        for (const int node : mesh.tets.col(t)) x += mesh.nodes(0, node) / 4;
        mesh.labels[t] = x < 10 ? 1 : 2;
    }
    const Interfaces interfaces(mesh);
    double inner_area = 0, outer_area = 0;
    for (const InterfaceNode& node : interfaces.nodes()) {
        (node.outer == 0 ? outer_area : inner_area) += node.area;
        if (node.outer == 0) continue;
        EXPECT_EQ(node.inner, 2);
        EXPECT_EQ(node.outer, 1);
        EXPECT_NEAR((node.normal - Vector3d(-1, 0, 0)).norm(), 0, 1e-12);  // from 2 into 1
        EXPECT_NEAR(mesh.nodes(0, node.node), 10, 1e-12);
    }
    EXPECT_NEAR(inner_area, 100, 1e-9);
    EXPECT_NEAR(outer_area, 4 * 200 + 2 * 100, 1e-9);
}

TEST(Interfaces, NormalsTurnWithTheMesh) {
    const auto mesh = meshing::box_mesh({20, 10, 10}, {4, 2, 2});
    const Interfaces interfaces(mesh);
    const Eigen::Isometry3d motion = shapes::motion(40, {1, 2, 3}, {5, 6, 7});
    const Eigen::Matrix3Xd turned = interfaces.normals(motion * mesh.nodes);
    for (std::size_t i = 0; i < interfaces.nodes().size(); ++i)
        EXPECT_NEAR((turned.col(static_cast<Eigen::Index>(i)) - motion.linear() * interfaces.nodes()[i].normal).norm(),
                    0, 1e-12);
}

// In the middle of a face of 8 × 8 squares two edges lead no further than two squares, and never through the box.
TEST(Interfaces, NeighboursAreTwoEdgesAwayOnTheSurface) {
    const auto mesh = meshing::box_mesh({8, 8, 1}, {8, 8, 1});
    const Interfaces interfaces(mesh);
    const std::vector<std::vector<int>> neighbours = interfaces.neighbours();
    const auto place = [&](int entry) {
        return Vector3d(mesh.nodes.col(interfaces.nodes()[static_cast<std::size_t>(entry)].node));
    };
    const Vector3d corner = mesh.nodes.rowwise().minCoeff();
    for (int i = 0; i < static_cast<int>(neighbours.size()); ++i) {
        if ((place(i) - corner - Vector3d(4, 4, 0)).norm() > 1e-9) continue;
        const auto& near = neighbours[static_cast<std::size_t>(i)];
        EXPECT_GE(near.size(), 12u);
        EXPECT_LE(near.size(), 24u);
        for (const int n : near) {
            EXPECT_NE(n, i);
            EXPECT_LE((place(n) - place(i)).cwiseAbs().maxCoeff(), 2 + 1e-9);
            EXPECT_NEAR(place(n)[2], place(i)[2], 1e-9);
        }
    }
}

std::vector<Match> row_of(const std::vector<double>& distances) {
    std::vector<Match> matches;
    for (const double distance : distances) {
        Match match;
        match.found = true;
        match.distance_mm = distance;
        matches.push_back(match);
    }
    return matches;
}

// Each has two on both sides, as on a surface.
std::vector<std::vector<int>> along_a_row(int count) {
    std::vector<std::vector<int>> neighbours(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i)
        for (const int j : {i - 2, i - 1, i + 1, i + 2})
            if (j >= 0 && j < count) neighbours[static_cast<std::size_t>(i)].push_back(j);
    return neighbours;
}

// Tissue that resists leaves its boundary off by more than the scale all over: every match keeps its weight.
TEST(Weigh, MatchesThatAreOffTogetherKeepTheirWeight) {
    auto matches = row_of({3.0, 3.2, 3.4, 3.6, 3.8, 4.0, 4.2});
    detail::weigh(matches, along_a_row(7), 1.0);
    for (const auto& match : matches) EXPECT_EQ(match.weight, 1);
}

TEST(Weigh, AMatchThatIsOffAlonePullsWithTheForceOfOneScale) {
    auto matches = row_of({0.1, 0.0, -0.1, 4.0, 0.1, 0.0, 0.1});
    detail::weigh(matches, along_a_row(7), 1.0);
    for (std::size_t i = 0; i < matches.size(); ++i) {
        if (i == 3)
            EXPECT_NEAR(matches[i].weight * 4.0, 1, 0.05);
        else
            EXPECT_EQ(matches[i].weight, 1) << i;
    }
}

// Nothing vouches for it.
TEST(Weigh, AMatchWithoutNeighboursIsJudgedByItsDistance) {
    auto matches = row_of({2.0, 9.0});
    matches[1].found = false;
    detail::weigh(matches, {{1}, {0}}, 1.0);
    EXPECT_NEAR(matches[0].weight, 0.5, 1e-12);
}

/// A plate of squares of 1 mm whose upper side is to follow `wanted`, and has moved by `displacement` already.
struct Plate {
    meshing::TetMesh mesh = meshing::box_mesh({8, 8, 2}, {8, 8, 2});
    Interfaces interfaces{mesh};
    Eigen::Matrix3Xd displacement = Eigen::Matrix3Xd::Zero(3, mesh.node_count());
    std::vector<Match> matches{interfaces.nodes().size()};

    template <class Wanted>
    explicit Plate(const Wanted& wanted) {
        for (std::size_t i = 0; i < matches.size(); ++i)
            if (is_above(i)) matches[i] = {true, false, wanted(place(i)), 1.0};
    }
    [[nodiscard]] Vector3d place(std::size_t entry) const {
        return mesh.nodes.col(interfaces.nodes()[entry].node) - mesh.nodes.rowwise().minCoeff();
    }
    [[nodiscard]] bool is_above(std::size_t entry) const {
        return std::abs(interfaces.nodes()[entry].normal[2] - 1) < 1e-9;
    }
    [[nodiscard]] static bool is_centre(const Vector3d& place) { return (place - Vector3d(4, 4, 2)).norm() < 1e-9; }

    void leave_out_strays() {
        detail::leave_out_strays(matches, interfaces, interfaces.neighbours(), mesh.nodes, displacement,
                                 interfaces.normals(mesh.nodes + displacement));
    }
};

// The next fold of a surface, 3 mm further on, draws one node; what the others are to do stays.
TEST(LeaveOutStrays, AMatchThatPartsANodeFromItsNeighboursGoes) {
    Plate plate([](const Vector3d& place) { return Plate::is_centre(place) ? 4.0 : 1.0; });
    plate.leave_out_strays();
    for (std::size_t i = 0; i < plate.matches.size(); ++i)
        EXPECT_EQ(plate.matches[i].found, plate.is_above(i) && !Plate::is_centre(plate.place(i))) << i;
}

// A slope of 0.3, however far it has moved as a whole.
TEST(LeaveOutStrays, MatchesThatAgreeWithTheirNeighboursStay) {
    Plate plate([](const Vector3d& place) { return 9 + 0.3 * place[0]; });
    plate.leave_out_strays();
    for (std::size_t i = 0; i < plate.matches.size(); ++i) EXPECT_EQ(plate.matches[i].found, plate.is_above(i)) << i;
}

// It followed a stray match by 3 mm and has found the boundary there; its neighbours have stayed.
TEST(LeaveOutStrays, AMatchThatKeepsANodeApartGoes) {
    Plate plate([](const Vector3d&) { return 0.0; });
    for (std::size_t i = 0; i < plate.matches.size(); ++i)
        if (plate.is_above(i) && Plate::is_centre(plate.place(i)))
            plate.displacement(2, plate.interfaces.nodes()[i].node) = 3;
    plate.leave_out_strays();
    for (std::size_t i = 0; i < plate.matches.size(); ++i)
        EXPECT_EQ(plate.matches[i].found, plate.is_above(i) && !Plate::is_centre(plate.place(i))) << i;
}

// On its way back to them it is no stray, wherever it is now.
TEST(LeaveOutStrays, AMatchThatBringsANodeBackStays) {
    Plate plate([](const Vector3d& place) { return Plate::is_centre(place) ? -3.0 : 0.0; });
    for (std::size_t i = 0; i < plate.matches.size(); ++i)
        if (Plate::is_centre(plate.place(i))) plate.displacement(2, plate.interfaces.nodes()[i].node) = 3;
    plate.leave_out_strays();
    for (std::size_t i = 0; i < plate.matches.size(); ++i) EXPECT_EQ(plate.matches[i].found, plate.is_above(i)) << i;
}

}  // namespace
}  // namespace tissuewarp::registration
