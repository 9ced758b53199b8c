#include "study/reference.hpp"

#include "core/atomic_file.hpp"
#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "meshing/point_location.hpp"
#include "tled/load_path.hpp"
#include "tled/reference/discrete_energy.hpp"
#include "tled/reference/newton.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <cmath>

namespace tissuewarp::study {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr const char* format = "tissuewarp study reference";
constexpr int version = 1;

/// The answer of linear tetrahedra between the corners under imposed displacements, carried to the middles of edges: a
/// tenth of the iterations that Newton's method takes from rest.
Matrix3Xd start_of(const Body& body, const Physics& physics, const meshing::TetMesh& linear,
                   const tled::QuadraticMesh& mesh) {
    tled::Model model;
    model.mesh = linear;
    model.materials[1] = material_of(physics);
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions held = conditions_of(body, Hold::Hard, linear, mesh);
    std::erase_if(held.prescribed, [&](const auto& each) { return each.node >= mesh.corner_count; });
    const auto conditions = tled::nodal_conditions(held, mesh.corner_count);
    const tled::RestStiffness stiffness(rest, conditions);
    const auto engine = tled::make_cpu_engine(rest, tled::Scalar::Float64);
    Matrix3Xd u(3, mesh.node_count());
    u.leftCols(mesh.corner_count) = tled::equilibrium_along_load(*engine, stiffness, conditions).displacement;
    for (const auto& [edge, middle] : mesh.middle) u.col(middle) = 0.5 * (u.col(edge.first) + u.col(edge.second));
    return u;
}

Matrix3Xd newton(const tled::DiscreteEnergy& energy, const tled::NodalConditions& conditions, double tolerance_mm,
                 Observer& observer, Matrix3Xd start = {}) {
    tled::NewtonOptions options;
    options.tolerance_mm = tolerance_mm;
    options.max_iterations = 300;  // near ν = ½ under full load, some 100
    options.start = std::move(start);
    return tled::newton_equilibrium(energy, conditions, options, observer).displacement;
}

/// By central differences of a small part of the load: of third order in it, and large enough for the line search,
/// which compares energies that rounding blurs.
Matrix3Xd linear_answer(const tled::DiscreteEnergy& energy, const tled::NodalConditions& conditions,
                        Observer& observer) {
    constexpr double part = 0.02, tolerance_mm = 1e-6;
    return (newton(energy, scaled(conditions, part), tolerance_mm, observer) -
            newton(energy, scaled(conditions, -part), tolerance_mm, observer)) /
           (2 * part);
}

/// u at places of the body, from that of its part.
class Sampler {
public:
    Sampler(const Body& body, const meshing::TetMesh& linear, const tled::QuadraticMesh& mesh, const Matrix3Xd& u)
        : body_(body), locator_(linear), mesh_(mesh), u_(u) {}

    [[nodiscard]] Vector3d operator()(const Vector3d& X) const {
        Vector3d folded = X, sign = Vector3d::Ones(), shift = Vector3d::Zero();
        for (int c = 0; body_.symmetry && c < 3; ++c) {
            const double centre = body_.symmetry->centre[c];
            if (X[c] <= centre) continue;
            folded[c] = 2 * centre - X[c];
            sign[c] = -1;
            shift[c] = 2 * body_.symmetry->displacement[c];
        }
        return sign.cwiseProduct(at(folded)) + shift;
    }

private:
    [[nodiscard]] Vector3d at(const Vector3d& X) const {
        constexpr double near_by = 0.5;  // of an element
        auto location = locator_.find(X);
        if (!location) location = locator_.find(X, near_by);
        if (!location) throw SolverFailure("a place where errors are measured lies outside the reference mesh");
        Eigen::Matrix<double, 3, 10> u;
        for (int c = 0; c < 10; ++c) u.col(c) = u_.col(mesh_.tets(c, location->tet));
        return u * tled::quadratic_shape(location->barycentric.tail<3>());
    }

    const Body& body_;
    meshing::PointLocator locator_;
    const tled::QuadraticMesh& mesh_;
    const Matrix3Xd& u_;
};

int coarser(int tetrahedra) {
    return static_cast<int>(std::lround(0.4 * tetrahedra));
}

/// At the samples.
Matrix3Xd answer_of(const Body& body, const Physics& physics, int tetrahedra, Observer& observer) {
    const meshing::TetMesh linear = body.reference_mesh(tetrahedra, observer);
    const tled::QuadraticMesh mesh = tled::quadratic_mesh(linear);
    const tled::QuadraticTetrahedra energy(mesh, {{1, material_of(physics)}},
                                           {.pressure = tled::QuadraticPressure::NodalAverage});
    const auto conditions = tled::nodal_conditions(conditions_of(body, physics.hold, linear, mesh), mesh.node_count());
    constexpr double tolerance_mm = 1e-6;
    const Matrix3Xd u = physics.law == Law::Linear
                            ? linear_answer(energy, conditions, observer)
                            : newton(energy, conditions, tolerance_mm, observer, start_of(body, physics, linear, mesh));
    const Sampler sampler(body, linear, mesh, u);
    Matrix3Xd answer(3, body.samples.cols());
    for (Eigen::Index i = 0; i < body.samples.cols(); ++i) answer.col(i) = sampler(body.samples.col(i));
    return answer;
}

}  // namespace

Reference reference_of(const Body& body, const Physics& physics, int tetrahedra, Observer& observer) {
    Reference reference;
    reference.tetrahedra = tetrahedra;
    reference.coarser = answer_of(body, physics, coarser(tetrahedra), observer);
    reference.displacement = answer_of(body, physics, tetrahedra, observer);
    const Eigen::VectorXd distance = (reference.displacement - reference.coarser).colwise().norm();
    reference.uncertainty_mm = std::sqrt(distance.squaredNorm() / double(distance.size()));
    reference.largest_uncertainty_mm = distance.maxCoeff();
    return reference;
}

Reference changed_reference(const Body& body, const Physics& physics, const Reference& own, Observer& observer) {
    Reference changed = own;
    changed.coarser = answer_of(body, physics, coarser(own.tetrahedra), observer);
    changed.displacement += changed.coarser - own.coarser;
    return changed;
}

void write_reference(const Reference& reference, const std::filesystem::path& path) {
    AtomicFile target(path);
    Hdf5Output file(target.path(), format, version);
    file.columns<double>("displacement", reference.displacement, "mm");
    file.columns<double>("coarser", reference.coarser, "mm");
    file.scalar<double>("uncertainty", reference.uncertainty_mm, "mm");
    file.scalar<double>("largest_uncertainty", reference.largest_uncertainty_mm, "mm");
    file.scalar<int>("tetrahedra", reference.tetrahedra, "1");
    file.close();
    target.commit();
}

Reference read_reference(const std::filesystem::path& path) {
    const Hdf5Input file(path, format, version, version);
    return {file.columns<double>("displacement", 3), file.columns<double>("coarser", 3),
            file.scalar<double>("uncertainty"), file.scalar<double>("largest_uncertainty"),
            file.scalar<int>("tetrahedra")};
}

}  // namespace tissuewarp::study
