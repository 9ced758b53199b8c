#include "tled/reference/quadrature.hpp"

#include <cmath>

namespace tissuewarp::tled::detail {

namespace {

// The four points with barycentric coordinates (a, b, b, b), b = (1 − a)/3.
void add_vertex_orbit(double a, double weight, std::vector<QuadraturePoint>& rule) {
    const double b = (1.0 - a) / 3.0;
    rule.push_back({{b, b, b}, weight});
    for (int k = 0; k < 3; ++k) {
        Eigen::Vector3d local(b, b, b);
        local[k] = a;
        rule.push_back({local, weight});
    }
}

// The six points with barycentric coordinates (a, a, b, b), b = ½ − a.
void add_edge_orbit(double a, double weight, std::vector<QuadraturePoint>& rule) {
    const double b = 0.5 - a;
    for (int k = 0; k < 3; ++k) {
        Eigen::Vector3d local(b, b, b);
        local[k] = a;  // with L_0 = a
        rule.push_back({local, weight});
        rule.push_back({Eigen::Vector3d::Constant(0.5) - local, weight});
    }
}

}  // namespace

std::vector<QuadraturePoint> tetrahedron_rule(Quadrature quadrature) {
    std::vector<QuadraturePoint> rule;
    const Eigen::Vector3d centre = Eigen::Vector3d::Constant(0.25);
    switch (quadrature) {
        case Quadrature::Points4:
            add_vertex_orbit((5.0 + 3.0 * std::sqrt(5.0)) / 20.0, 1.0 / 24.0, rule);
            break;
        case Quadrature::Points5:
            rule.push_back({centre, -2.0 / 15.0});
            add_vertex_orbit(0.5, 3.0 / 40.0, rule);
            break;
        case Quadrature::Points11:
            rule.push_back({centre, -74.0 / 5625.0});
            add_vertex_orbit(11.0 / 14.0, 343.0 / 45000.0, rule);
            add_edge_orbit((1.0 + std::sqrt(5.0 / 14.0)) / 4.0, 28.0 / 1125.0, rule);
            break;
    }
    return rule;
}

std::vector<TrianglePoint> triangle_rule() {
    std::vector<TrianglePoint> rule;
    const auto add_orbit = [&](double a, double weight) {
        const double b = 0.5 * (1.0 - a);
        for (int k = 0; k < 3; ++k) {
            Eigen::Vector3d barycentric(b, b, b);
            barycentric[k] = a;
            rule.push_back({barycentric, weight});
        }
    };
    add_orbit(0.108103018168070, 0.5 * 0.223381589678011);
    add_orbit(0.816847572980459, 0.5 * 0.109951743655322);
    return rule;
}

}  // namespace tissuewarp::tled::detail
