#include "meshing/detail/relaxation.hpp"

#include "meshing/detail/faces.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

namespace tissuewarp::meshing::detail {

namespace {

constexpr int fitting_rounds = 3, relaxing_rounds = 12;
/// 1/√(Σ|∇N|²) over the target edge is 0.41 in the regular tetrahedron and about 0.2 at the median of a refined mesh;
/// elements below this are worth improving.
constexpr double wanted_step = 0.16;
/// Fitting may not make an element worse than this.
constexpr double least_step = 0.08;
/// Below this even nodes move at which several interfaces or sharp edges meet.
constexpr double desperate_step = 0.04;

/// The worst of the elements around a node.
struct Worst {
    double step = 0.0;    ///< smallest 1/√(Σ|∇N|²) over target edge; 0 when one is inverted
    double cosine = 1.0;  ///< of the smallest dihedral angle
    int tet = -1;

    void include(int t, double its_step, double its_cosine) {
        if (its_step < step) {
            step = its_step;
            tet = t;
        }
        cosine = std::max(cosine, its_cosine);
    }
};

class Relaxation {
public:
    Relaxation(TetMesh& mesh, const RelaxationInput& input)
        : mesh_(mesh), input_(input), largest_cosine_(std::cos(input.min_dihedral_deg * std::numbers::pi / 180.0)) {
        index_tets();
        faces_ = interface_faces(mesh_);
        active_.assign(static_cast<std::size_t>(mesh_.node_count()), true);
    }

    void run() {
        for (int round = 0; round < fitting_rounds; ++round) fit();
        for (int round = 0; round < relaxing_rounds; ++round)
            if (relax_worst() == 0) break;
        fit();
    }

private:
    void index_tets() {
        start_.assign(static_cast<std::size_t>(mesh_.node_count()) + 1, 0);
        for (int node : mesh_.tets.reshaped()) ++start_[static_cast<std::size_t>(node) + 1];
        for (std::size_t n = 1; n < start_.size(); ++n) start_[n] += start_[n - 1];
        tets_.resize(static_cast<std::size_t>(start_.back()));
        std::vector<int> next(start_.begin(), start_.end() - 1);
        for (int t = 0; t < mesh_.tet_count(); ++t)
            for (int node : mesh_.tets.col(t))
                tets_[static_cast<std::size_t>(next[static_cast<std::size_t>(node)]++)] = t;
    }

    /// Of one tetrahedron; a step of 0 where it is inverted.
    struct Shape {
        Eigen::Matrix<double, 3, 4> areas;  ///< outward, of the face opposite each corner
        double step = 0.0;

        [[nodiscard]] double largest_cosine() const {
            const Eigen::RowVector4d norms = areas.colwise().norm();
            double result = -1.0;
            for (const auto& [i, j] : edge_corners)
                result = std::max(result, -areas.col(i).dot(areas.col(j)) / (norms[i] * norms[j]));
            return result;
        }
    };

    [[nodiscard]] Shape shape(int t) const {
        Shape result;
        const auto nodes = mesh_.tets.col(t);
        for (int corner = 0; corner < 4; ++corner) {
            const auto& c = face_corners[corner];
            const Eigen::Vector3d origin = mesh_.nodes.col(nodes[c[0]]);
            const Eigen::Vector3d a = mesh_.nodes.col(nodes[c[1]]) - origin, b = mesh_.nodes.col(nodes[c[2]]) - origin;
            result.areas.col(corner) = 0.5 * a.cross(b);
        }
        const Eigen::Vector3d edge = mesh_.nodes.col(nodes[0]) - mesh_.nodes.col(nodes[1]);
        const double volume = result.areas.col(0).dot(-edge) / 3.0;  // outward area times height of corner 0, below it
        if (volume > 0.0)
            result.step =
                3.0 * volume / result.areas.norm() / input_.edge_length[static_cast<std::size_t>(mesh_.labels[t])];
        return result;
    }

    [[nodiscard]] Worst around(int node) const {
        Worst worst{1e300, -1.0, -1};
        for (const int t : tets_around(node)) {
            const Shape of_tet = shape(t);
            if (!(of_tet.step > 0.0)) return {0.0, 1.0, t};
            worst.include(t, of_tet.step, of_tet.largest_cosine());
        }
        return worst;
    }

    /// What is around a node if no element there has a smaller step than `least` and none a sharper angle than the
    /// sharpest was before, or than is allowed. Most places fail at once, by the element that is to be improved.
    [[nodiscard]] std::optional<Worst> around_if_kept(int node, const Worst& before, double least,
                                                      int to_improve) const {
        const auto long_enough = [&](const Shape& of_tet) { return of_tet.step > 0.0 && of_tet.step >= least; };
        if (!long_enough(shape(to_improve))) return std::nullopt;
        const double allowed = std::max(before.cosine, largest_cosine_);
        Worst worst{1e300, -1.0, -1};
        for (const int t : tets_around(node)) {
            const Shape of_tet = shape(t);
            if (!long_enough(of_tet)) return std::nullopt;
            const double cosine = of_tet.largest_cosine();
            if (!(cosine <= allowed)) return std::nullopt;
            worst.include(t, of_tet.step, cosine);
        }
        return worst;
    }

    [[nodiscard]] std::span<const int> tets_around(int node) const {
        const auto n = static_cast<std::size_t>(node);
        return std::span(tets_).subspan(static_cast<std::size_t>(start_[n]),
                                        static_cast<std::size_t>(start_[n + 1] - start_[n]));
    }

    /// Signed distance along `normal` from a point of a face to where its inner label ends; 0 when it is not near.
    [[nodiscard]] double offset(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner) const {
        const double limit = std::max(2.0 * input_.facet_distance, input_.voxel), step = 0.25 * input_.voxel;
        const bool inside = input_.field(point) == inner;
        const double side = inside ? 1.0 : -1.0;
        double near = 0.0;
        for (double far = step; near < limit; near = far, far += step) {
            if ((input_.field(point + side * far * normal) == inner) == inside) continue;
            for (int cut = 0; cut < 5; ++cut) {
                const double middle = 0.5 * (near + far);
                ((input_.field(point + side * middle * normal) == inner) == inside ? near : far) = middle;
            }
            return side * 0.5 * (near + far);
        }
        return 0.0;
    }

    void fit() {
        Eigen::Matrix3Xd shift = Eigen::Matrix3Xd::Zero(3, mesh_.node_count());
        Eigen::VectorXd weight = Eigen::VectorXd::Zero(mesh_.node_count());
        for (const InterfaceFace& face : faces_) {
            const Eigen::Matrix3d x = mesh_.nodes(Eigen::all, face.nodes);
            const Eigen::Vector3d cross = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
            const double twice_area = cross.norm();
            if (!(twice_area > 0.0)) continue;
            const Eigen::Vector3d normal = cross / twice_area;
            double mean = 0.0;  // the three-point rule, exact for quadratic surfaces
            for (int k = 0; k < 3; ++k)
                mean += offset(x * (Eigen::Vector3d::Constant(1.0 / 6.0) + 0.5 * Eigen::Vector3d::Unit(k)), normal,
                               face.inner) /
                        3.0;
            for (int node : face.nodes) {
                shift.col(node) += twice_area * mean * normal;
                weight[node] += twice_area;
            }
        }
        for (int node = 0; node < mesh_.node_count(); ++node) {
            if (!(weight[node] > 0.0)) continue;
            const Worst before = around(node);
            const Eigen::Vector3d home = mesh_.nodes.col(node), full = shift.col(node) / weight[node];
            bool moved = false;
            for (double part : {1.0, 0.5, 0.25}) {
                mesh_.nodes.col(node) = home + part * full;
                moved = around_if_kept(node, before, std::min(before.step, least_step), before.tet).has_value();
                if (moved) break;
            }
            if (!moved) mesh_.nodes.col(node) = home;
        }
    }

    /// Unit normal of each interface node; NaN where several interfaces or a sharp edge meet, zero inside.
    [[nodiscard]] Eigen::Matrix3Xd interface_normals() const {
        Eigen::Matrix3Xd normals = Eigen::Matrix3Xd::Zero(3, mesh_.node_count());
        Eigen::VectorXd area = Eigen::VectorXd::Zero(mesh_.node_count());
        std::vector<std::pair<int, int>> labels(static_cast<std::size_t>(mesh_.node_count()), {-1, -1});
        for (const InterfaceFace& face : faces_) {
            const Eigen::Matrix3d x = mesh_.nodes(Eigen::all, face.nodes);
            const Eigen::Vector3d cross = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
            for (int node : face.nodes) {
                auto& own = labels[static_cast<std::size_t>(node)];
                const std::pair here{face.inner, face.outer};
                if (own.first < 0) own = here;
                if (own != here) normals.col(node).setConstant(std::nan(""));
                normals.col(node) += cross;
                area[node] += cross.norm();
            }
        }
        for (int node = 0; node < mesh_.node_count(); ++node) {
            if (!(area[node] > 0.0)) continue;
            const bool smooth = normals.col(node).norm() > 0.8 * area[node];
            if (smooth)
                normals.col(node).normalize();
            else
                normals.col(node).setConstant(std::nan(""));
        }
        return normals;
    }

    /// Returns how many nodes moved.
    int relax_worst() {
        const Eigen::Matrix3Xd normals = interface_normals();
        int moved = 0;
        for (int node = 0; node < mesh_.node_count(); ++node) {
            // A node fails again where nothing around it has changed.
            if (!active_[static_cast<std::size_t>(node)]) continue;
            active_[static_cast<std::size_t>(node)] = false;
            Worst best = around(node);
            Eigen::Vector3d normal = normals.col(node);
            if (best.step >= (normal.allFinite() ? wanted_step : desperate_step)) continue;
            if (!normal.allFinite()) normal.setZero();
            const Worst before = best;
            const Eigen::Vector3d home = mesh_.nodes.col(node);
            Eigen::Vector3d place = home;
            const double edge = input_.edge_length[static_cast<std::size_t>(mesh_.labels[best.tet])];
            for (const Eigen::Vector3d& direction : directions(node, best.tet)) {
                Eigen::Vector3d along = direction - direction.dot(normal) * normal;
                if (along.norm() < 1e-12) continue;
                along.normalize();
                for (double length : {0.16, 0.08, 0.04, 0.02}) {
                    mesh_.nodes.col(node) = home + length * edge * along;
                    const std::optional<Worst> after = around_if_kept(node, before, best.step, best.tet);
                    if (!after || !(after->step > best.step)) continue;
                    best = *after;
                    place = mesh_.nodes.col(node);
                }
            }
            mesh_.nodes.col(node) = place;
            if (place == home) continue;
            ++moved;
            for (const int t : tets_around(node))
                for (int neighbour : mesh_.tets.col(t)) active_[static_cast<std::size_t>(neighbour)] = true;
        }
        return moved;
    }

    /// Towards the centroid of the neighbours, both ways across each edge's plane of the worst element, along the axes.
    [[nodiscard]] std::array<Eigen::Vector3d, 10> directions(int node, int worst) const {
        Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
        const std::span<const int> tets = tets_around(node);
        for (const int t : tets) centroid += mesh_.nodes(Eigen::all, mesh_.tets.col(t)).rowwise().mean();
        centroid /= static_cast<double>(tets.size());
        std::array<Eigen::Vector3d, 10> result;
        result[0] = centroid - mesh_.nodes.col(node);
        const auto nodes = mesh_.tets.col(worst);
        for (int corner = 0; corner < 4; ++corner) {
            if (nodes[corner] != node) continue;
            const auto& c = face_corners[corner];  // away from the opposite face raises the height and the volume
            const Eigen::Vector3d origin = mesh_.nodes.col(nodes[c[0]]);
            const Eigen::Vector3d a = mesh_.nodes.col(nodes[c[1]]) - origin, b = mesh_.nodes.col(nodes[c[2]]) - origin;
            result[1] = -a.cross(b);
            result[2] = a.cross(b);
            result[3] = result[0].normalized() + result[1].normalized();
        }
        for (int axis = 0; axis < 3; ++axis) {
            result[static_cast<std::size_t>(4 + 2 * axis)] = Eigen::Vector3d::Unit(axis);
            result[static_cast<std::size_t>(5 + 2 * axis)] = -Eigen::Vector3d::Unit(axis);
        }
        return result;
    }

    TetMesh& mesh_;
    const RelaxationInput& input_;
    double largest_cosine_;
    std::vector<int> start_, tets_;  ///< tetrahedra around each node
    std::vector<InterfaceFace> faces_;
    std::vector<bool> active_;  ///< nodes worth trying to move
};

}  // namespace

void relax(TetMesh& mesh, const RelaxationInput& input) {
    Relaxation(mesh, input).run();
}

}  // namespace tissuewarp::meshing::detail
