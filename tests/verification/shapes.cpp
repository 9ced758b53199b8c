#include "tests/verification/shapes.hpp"

#include "meshing/primitives.hpp"

#include <cmath>

namespace tissuewarp::verification {

using Eigen::Vector3d;

std::vector<double> graded(double length, int cells, double grading) {
    std::vector<double> result;
    for (int i = 0; i <= cells; ++i) result.push_back(length * std::pow(static_cast<double>(i) / cells, grading));
    return result;
}

std::vector<double> graded_up(double length, int cells, double grading) {
    std::vector<double> result = graded(length, cells, grading);
    for (double& x : result) x = length - x;
    return {result.rbegin(), result.rend()};
}

std::vector<double> graded_both_ways(double length, int cells, double grading) {
    std::vector<double> result;
    for (int i = 0; i <= cells; ++i) {
        const double t = static_cast<double>(i) / cells;
        const double low = 0.5 * length * std::pow(2.0 * std::min(t, 1.0 - t), grading);
        result.push_back(t > 0.5 ? length - low : low);
    }
    return result;
}

meshing::TetMesh symmetric_box(const std::array<std::vector<double>, 3>& coordinates) {
    meshing::TetMesh mesh = meshing::box_mesh(coordinates);
    std::array<int, 3> nodes{}, stride{1, 0, 0};
    for (std::size_t c = 0; c < 3; ++c) nodes[c] = static_cast<int>(coordinates[c].size());
    stride[1] = nodes[0];
    stride[2] = nodes[0] * nodes[1];
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const int cell = t / 6;  // as box_mesh numbers them
        const std::array<int, 3> at{cell % (nodes[0] - 1), cell / (nodes[0] - 1) % (nodes[1] - 1),
                                    cell / ((nodes[0] - 1) * (nodes[1] - 1))};
        bool mirrored = false;
        for (std::size_t c = 0; c < 3; ++c) {
            const auto i = static_cast<std::size_t>(at[c]);
            if (coordinates[c][i] + coordinates[c][i + 1] > 0.0) continue;
            mirrored = !mirrored;
            for (int& node : mesh.tets.col(t)) {
                const int low = node / stride[c] % nodes[c] - at[c];  // 0 or 1
                node += (1 - 2 * low) * stride[c];
            }
        }
        if (mirrored) std::swap(mesh.tets(2, t), mesh.tets(3, t));
    }
    return mesh;
}

Vector3d sphere_point(const Vector3d& on_cube, const Rims& rims) {
    const double r = on_cube.head<2>().cwiseAbs().maxCoeff();
    double angle = 0.5 * (rims.top * (1.0 + on_cube[2]) + rims.bottom * (1.0 - on_cube[2]));
    if (r < 1.0) angle = on_cube[2] > 0.0 ? rims.top * r : M_PI - (M_PI - rims.bottom) * r;
    Vector3d result(0.0, 0.0, std::cos(angle));
    const double length = on_cube.head<2>().norm();
    if (length > 0.0) result.head<2>() = std::sin(angle) / length * on_cube.head<2>();
    return result;
}

Vector3d ball_point(const Vector3d& in_cube, const Rims& rims) {
    const double shell = in_cube.cwiseAbs().maxCoeff();
    return shell > 0.0 ? Vector3d(shell * sphere_point(in_cube / shell, rims)) : Vector3d::Zero();
}

}  // namespace tissuewarp::verification
