#include "study/detail/random_loads.hpp"

#include <cmath>

namespace tissuewarp::study::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

Cap random_cap(const OrganShape& shape, Random& random, double smallest, double largest) {
    const Vector3d middle = shape.surface_point(random.direction());
    return {middle, shape.length() * random.uniform(smallest, largest)};
}

/// Areas that the nodes of the outer surface stand for, mm²: ∫ N_i dA.
Eigen::VectorXd nodal_areas(const tled::QuadraticMesh& mesh, const std::vector<meshing::InterfaceFace>& faces) {
    Matrix3Xd areas = Matrix3Xd::Zero(3, mesh.node_count());
    for (const meshing::InterfaceFace& face : faces) tled::add_traction(mesh, face.nodes, Vector3d::UnitX(), areas);
    return areas.row(0).transpose().cwiseMax(0);
}

void lay_bed(const Bed& bed, const tled::QuadraticMesh& mesh, const Eigen::VectorXd& areas,
             std::vector<tled::Spring>& springs) {
    for (int node = 0; node < mesh.node_count(); ++node) {
        if (areas[node] <= 0) continue;
        const double weight = bed.cap.weight(mesh.nodes.col(node));
        if (weight <= 0) continue;
        const double stiffness = bed.stiffness * weight * areas[node];
        springs.push_back({node, stiffness * Eigen::Matrix3d::Identity(), weight * bed.displacement});
    }
}

}  // namespace

std::vector<meshing::InterfaceFace> outer_faces(const meshing::TetMesh& mesh) {
    std::vector<meshing::InterfaceFace> faces = meshing::interface_faces(mesh);
    std::erase_if(faces, [](const meshing::InterfaceFace& face) { return face.outer != 0; });
    return faces;
}

double Cap::weight(const Vector3d& point) const {
    const double r = (point - middle).norm() / radius_mm;
    return r < 1 ? 0.5 * (1 + std::cos(EIGEN_PI * r)) : 0;
}

RandomLoads random_loads(const OrganShape& shape, double youngs_modulus_kpa, Random& random) {
    RandomLoads loads;
    const double modulus = youngs_modulus_kpa, length = shape.length();
    const int held = 1 + random.index(2);
    for (int k = 0; k < held; ++k) {
        const Cap cap = random_cap(shape, random, 0.35, 0.6);
        loads.held.push_back({cap, modulus * random.log_uniform(0.02, 0.5)});
    }
    // Any of three, at least one; sizes that move the tissue by a few mm each.
    const int mixture = 1 + random.index(7);
    constexpr double mm = 5;
    if (mixture & 1) {
        const double size = random.uniform(0.3, 1) * mm * modulus * 4 / (length * length);
        loads.body_force = size * random.direction();
        loads.words += " gravity";
    }
    if (mixture & 2) {
        const int patches = 1 + random.index(3);
        for (int k = 0; k < patches; ++k) {
            const Cap cap = random_cap(shape, random, 0.2, 0.45);
            const double sign = random.uniform() < 0.7 ? 1 : -1;
            loads.pressures.push_back({cap, sign * random.uniform(0.3, 1) * mm * modulus / cap.radius_mm});
        }
        loads.words += " pressure";
    }
    if (mixture & 4) {
        const Cap cap = random_cap(shape, random, 0.15, 0.3);
        const Vector3d along = (-shape.normal(cap.middle) + 0.3 * random.normal3()).normalized();
        loads.pressed.push_back({cap, 0.5 * modulus, mm * random.uniform(0.5, 1.5) * along});
        loads.words += " press";
    }
    return loads;
}

RandomLoads bulging_loads(const OrganShape& shape, double youngs_modulus_kpa, Random& random) {
    const double modulus = youngs_modulus_kpa, length = shape.length();
    const Vector3d towards = random.direction();
    const Cap opening{shape.surface_point(towards), length * random.uniform(0.2, 0.35)};
    const Vector3d opposite = shape.surface_point(-towards);
    RandomLoads loads;
    loads.held.push_back({{opposite, (opposite - opening.middle).norm()}, modulus * random.log_uniform(0.2, 2)});
    loads.pressures.push_back({opening, -modulus});
    loads.words = " what bulges through an opening";
    return loads;
}

RandomLoads scaled(RandomLoads loads, double factor) {
    loads.body_force *= factor;
    for (Pressure& pressure : loads.pressures) pressure.kpa *= factor;
    for (Bed& bed : loads.pressed) bed.displacement *= factor;
    return loads;
}

tled::NodalConditions conditions_on(const tled::QuadraticMesh& mesh, const meshing::TetMesh& corners,
                                    const OrganShape& shape, const RandomLoads& loads) {
    return conditions_on(mesh, corners, outer_faces(corners), shape, loads);
}

tled::NodalConditions conditions_on(const tled::QuadraticMesh& mesh, const meshing::TetMesh& corners,
                                    const std::vector<meshing::InterfaceFace>& faces, const OrganShape& shape,
                                    const RandomLoads& loads) {
    const Eigen::VectorXd areas = nodal_areas(mesh, faces);
    tled::Conditions conditions;
    conditions.external_force = tled::body_load(mesh, loads.body_force);
    for (const meshing::InterfaceFace& face : faces) {
        const Vector3d middle =
            (corners.nodes.col(face.nodes[0]) + corners.nodes.col(face.nodes[1]) + corners.nodes.col(face.nodes[2])) /
            3;
        double kpa = 0;
        for (const Pressure& pressure : loads.pressures) kpa += pressure.kpa * pressure.cap.weight(middle);
        if (kpa != 0) tled::add_traction(mesh, face.nodes, -kpa * shape.normal(middle), conditions.external_force);
    }
    for (const Bed& bed : loads.held) lay_bed(bed, mesh, areas, conditions.springs);
    for (const Bed& bed : loads.pressed) lay_bed(bed, mesh, areas, conditions.springs);
    return tled::nodal_conditions(conditions, mesh.node_count());
}

}  // namespace tissuewarp::study::detail
