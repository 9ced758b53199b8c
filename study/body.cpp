#include "study/body.hpp"

#include "imaging/filters.hpp"
#include "meshing/mesher.hpp"
#include "meshing/primitives.hpp"
#include "study/label_mesh.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace tissuewarp::study {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr double edge = 100, stretch = 20;  // mm, of the cube

int cells_for(int tetrahedra) {
    return std::max(1, static_cast<int>(std::lround(std::cbrt(tetrahedra / 6.0))));
}

Matrix3Xd as_columns(const std::vector<Vector3d>& points) {
    Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
    return columns;
}

Matrix3Xd cube_samples() {
    std::vector<Vector3d> points;
    constexpr std::array at{5.0, 17.0, 29.0, 41.0, 53.0, 65.0, 77.0, 89.0};  // mm: on no plane of a mesh for long
    for (const double z : at)
        for (const double y : at)
            for (const double x : at) points.emplace_back(x, y, z);
    return as_columns(points);
}

/// 0 at t ≤ 0, 1 at t ≥ 1, smooth between.
double smooth_step(double t) {
    const double s = std::clamp(t, 0.0, 1.0);
    return s * s * (3 - 2 * s);
}

/// Where an organ is dented and held, in the frame of its label map.
struct Dent {
    Vector3d outward{0, -0.8, 0.6};  // LPS: to the front and above
    Vector3d centre = Vector3d::Zero();
    double low = std::numeric_limits<double>::max(), high = -low;  // mm, along S

    explicit Dent(const imaging::Volume& tissue) {
        const auto& size = tissue.geometry.size;
        double furthest = -std::numeric_limits<double>::max();
        for (int k = 0; k < size[2]; ++k)
            for (int j = 0; j < size[1]; ++j)
                for (int i = 0; i < size[0]; ++i) {
                    if (tissue.data<std::int32_t>()[tissue.offset(i, j, k)] == 0) continue;
                    const Vector3d X = tissue.geometry.point(Vector3d(i, j, k));
                    low = std::min(low, X.z());
                    high = std::max(high, X.z());
                    if (outward.dot(X) <= furthest) continue;
                    furthest = outward.dot(X);
                    centre = X;
                }
    }

    [[nodiscard]] double scale() const { return std::min(1.0, (high - low) / 100); }

    [[nodiscard]] Pull pull(const Vector3d& X) const {
        constexpr double depth = 10, radius = 40, fade = 20;  // mm
        const double anchored = low + 0.1 * (high - low);
        const double held = smooth_step((anchored - X.z()) / (fade * scale()) + 0.5);
        if (held > 0) return {held, Vector3d::Zero()};
        const double part = (X - centre).norm() / (radius * scale());
        if (part >= 1) return {};
        const double bump = std::pow(1 - part * part, 2);
        return {bump, -depth * scale() * bump * outward};
    }
};

/// Voxel centres about `step` apart, at least `depth` below the surface.
Matrix3Xd samples_of(const imaging::Volume& tissue, double step, double depth) {
    const imaging::Volume distance = imaging::signed_distance(tissue);
    const auto& [size, spacing] = std::tie(tissue.geometry.size, tissue.geometry.spacing);
    const auto stride = [&](int axis) { return std::max(1, static_cast<int>(std::lround(step / spacing[axis]))); };
    std::vector<Vector3d> points;
    for (int k = 0; k < size[2]; k += stride(2))
        for (int j = 0; j < size[1]; j += stride(1))
            for (int i = 0; i < size[0]; i += stride(0))
                if (distance.data<float>()[distance.offset(i, j, k)] < -depth)
                    points.push_back(tissue.geometry.point(Vector3d(i, j, k)));
    return as_columns(points);
}

/// A node of a boundary face that is pulled at, with the area (mm²) that it stands for there.
struct Pulled {
    int node;
    double area;
};

tled::Conditions pulled_conditions(const Body& body, Hold hold, const Matrix3Xd& nodes,
                                   const std::vector<Pulled>& pulled) {
    constexpr double stiffness = 3;  // kPa/mm
    std::vector<double> area(static_cast<std::size_t>(nodes.cols()), -1);
    for (const Pulled& each : pulled) {
        double& sum = area[static_cast<std::size_t>(each.node)];
        sum = std::max(sum, 0.0) + each.area;
    }
    tled::Conditions conditions;
    for (int node = 0; node < nodes.cols(); ++node) {
        const double a = area[static_cast<std::size_t>(node)];
        if (a < 0) continue;
        const Pull pull = body.pull(nodes.col(node));
        if (hold == Hold::Hard)
            conditions.prescribed.push_back({node, {true, true, true}, pull.displacement});
        else if (a > 0)
            conditions.springs.push_back(
                {node, stiffness * a * pull.weight * Eigen::Matrix3d::Identity(), pull.displacement});
    }
    return conditions;
}

/// The outer faces pulled at in all corners and in the middle, which a face between two plates is not.
std::vector<std::array<int, 3>> pulled_faces(const Body& body, const meshing::TetMesh& mesh) {
    const auto pulled = [&](const std::array<int, 3>& face) {
        Vector3d middle = Vector3d::Zero();
        for (const int node : face) {
            if (!(body.pull(mesh.nodes.col(node)).weight > 0)) return false;
            middle += mesh.nodes.col(node) / 3;
        }
        return body.pull(middle).weight > 0;
    };
    std::vector<std::array<int, 3>> faces;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh))
        if (face.outer == 0 && pulled(face.nodes)) faces.push_back(face.nodes);
    return faces;
}

double area_of(const meshing::TetMesh& mesh, const std::array<int, 3>& face) {
    const Vector3d a = mesh.nodes.col(face[0]), b = mesh.nodes.col(face[1]), c = mesh.nodes.col(face[2]);
    return 0.5 * (b - a).cross(c - a).norm();
}

/// Nodes on planes of symmetry stay on them; those that are held already keep what holds their other components.
void hold_on_planes(const Symmetry& symmetry, const Matrix3Xd& nodes, tled::Conditions& conditions) {
    std::vector<int> entry(static_cast<std::size_t>(nodes.cols()), -1);
    for (std::size_t i = 0; i < conditions.prescribed.size(); ++i)
        entry[static_cast<std::size_t>(conditions.prescribed[i].node)] = static_cast<int>(i);
    for (int node = 0; node < nodes.cols(); ++node)
        for (int c = 0; c < 3; ++c) {
            if (std::abs(nodes(c, node) - symmetry.centre[c]) > 1e-9) continue;
            int& at = entry[static_cast<std::size_t>(node)];
            if (at < 0) {
                at = static_cast<int>(conditions.prescribed.size());
                conditions.prescribed.push_back({node, {false, false, false}, Vector3d::Zero()});
            }
            tled::PrescribedDisplacement& held = conditions.prescribed[static_cast<std::size_t>(at)];
            held.constrained[static_cast<std::size_t>(c)] = true;
            held.displacement[c] = symmetry.displacement[c];
        }
}

}  // namespace

Body stretched_cube() {
    Body body;
    body.name = "cube";
    body.story = "a cube of 100 mm, its ends held and drawn 20 mm apart";
    body.mesh = [](int tetrahedra, Observer&) {
        const int cells = cells_for(tetrahedra);
        return meshing::box_mesh({edge, edge, edge}, {cells, cells, cells});
    };
    body.pull = [](const Vector3d& X) -> Pull {
        if (X.z() < 1e-6) return {1, Vector3d::Zero()};
        if (X.z() > edge - 1e-6) return {1, Vector3d(0, 0, stretch)};
        return {};
    };
    body.samples = cube_samples();
    body.symmetry = {Vector3d::Constant(edge / 2), Vector3d(0, 0, stretch / 2)};
    body.reference_mesh = [](int tetrahedra, Observer&) {  // an eighth, finer towards the singular rim of the end
        const int cells = cells_for(tetrahedra);
        std::vector<double> x;
        for (int i = 0; i <= cells; ++i) x.push_back(edge / 2 * std::pow(double(i) / cells, 2));
        return meshing::box_mesh({x, x, x});
    };
    return body;
}

Body indented_organ(const imaging::Volume& label_map) {
    const imaging::Volume tissue = one_tissue(label_map);
    const Dent dent(tissue);
    Body body;
    body.name = "brain";
    body.hold = Hold::Soft;
    body.story = "a brain, its base held and its frontal surface pressed in by springs";
    body.mesh = [tissue](int tetrahedra, Observer& observer) {
        meshing::MeshingOptions options;
        options.edge_length = edge_length_for(tissue, tetrahedra);
        return meshing::mesh_labels(tissue, options, observer);
    };
    body.reference_mesh = body.mesh;
    body.pull = [dent](const Vector3d& X) { return dent.pull(X); };
    body.samples = samples_of(tissue, 9 * dent.scale(), 5 * dent.scale());
    return body;
}

tled::Conditions conditions_of(const Body& body, Hold hold, const meshing::TetMesh& mesh) {
    std::vector<Pulled> pulled;
    for (const auto& face : pulled_faces(body, mesh))
        for (const int node : face) pulled.push_back({node, area_of(mesh, face) / 3});
    return pulled_conditions(body, hold, mesh.nodes, pulled);
}

tled::Conditions conditions_of(const Body& body, Hold hold, const meshing::TetMesh& linear,
                               const tled::QuadraticMesh& mesh) {
    std::vector<Pulled> pulled;
    for (const auto& face : pulled_faces(body, linear))
        for (int k = 0; k < 3; ++k) {
            const int a = face[static_cast<std::size_t>(k)], b = face[static_cast<std::size_t>((k + 1) % 3)];
            pulled.push_back({a, 0});
            pulled.push_back({mesh.middle.at(std::minmax(a, b)), area_of(linear, face) / 3});
        }
    tled::Conditions conditions = pulled_conditions(body, hold, mesh.nodes, pulled);
    if (body.symmetry) hold_on_planes(*body.symmetry, mesh.nodes, conditions);
    return conditions;
}

}  // namespace tissuewarp::study
