#include "study/reference.hpp"

#include "core/atomic_file.hpp"
#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "meshing/point_location.hpp"
#include "tled/reference.hpp"

#include <cmath>

namespace tissuewarp::study {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr const char* format = "tissuewarp study reference";
constexpr int version = 1;

Matrix3Xd newton(const tled::DiscreteEnergy& energy, const tled::NodalConditions& conditions, double tolerance_mm,
                 Observer& observer) {
    tled::NewtonOptions options;
    options.tolerance_mm = tolerance_mm;
    options.max_iterations = 300;  // near ν = ½ under full load, some 100
    return tled::newton_equilibrium(energy, conditions, options, observer).displacement;
}

tled::NodalConditions scaled(tled::NodalConditions conditions, double factor) {
    conditions.imposed *= factor;
    conditions.spring_force *= factor;
    return conditions;
}

Matrix3Xd solved(const tled::DiscreteEnergy& energy, const tled::NodalConditions& conditions, Law law,
                 Observer& observer) {
    if (law != Law::Linear) return newton(energy, conditions, 1e-6, observer);
    constexpr double part = 1e-3, tolerance_mm = 1e-9;
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

struct Answer {
    Matrix3Xd samples;
    int tetrahedra;
};

Answer answer_of(const Body& body, const Physics& physics, int tetrahedra, Observer& observer) {
    const meshing::TetMesh linear = body.reference_mesh(tetrahedra, observer);
    const tled::QuadraticMesh mesh = tled::quadratic_mesh(linear);
    const tled::QuadraticTetrahedra energy(mesh, {{1, material_of(physics)}},
                                           {.pressure = tled::QuadraticPressure::NodalAverage});
    const auto conditions = tled::nodal_conditions(conditions_of(body, physics.hold, linear, mesh), mesh.node_count());
    const Matrix3Xd u = solved(energy, conditions, physics.law, observer);
    const Sampler sampler(body, linear, mesh, u);
    Answer answer{Matrix3Xd(3, body.samples.cols()), linear.tet_count()};
    for (Eigen::Index i = 0; i < body.samples.cols(); ++i) answer.samples.col(i) = sampler(body.samples.col(i));
    return answer;
}

}  // namespace

Reference reference_of(const Body& body, const Physics& physics, int tetrahedra, Observer& observer) {
    constexpr double coarser = 0.4;
    const Answer coarse = answer_of(body, physics, static_cast<int>(std::lround(coarser * tetrahedra)), observer);
    const Answer fine = answer_of(body, physics, tetrahedra, observer);
    const Eigen::VectorXd distance = (fine.samples - coarse.samples).colwise().norm();
    return {fine.samples, std::sqrt(distance.squaredNorm() / double(distance.size())), distance.maxCoeff(),
            fine.tetrahedra};
}

void write_reference(const Reference& reference, const std::filesystem::path& path) {
    AtomicFile target(path);
    Hdf5Output file(target.path(), format, version);
    file.columns<double>("displacement", reference.displacement, "mm");
    file.scalar<double>("uncertainty", reference.uncertainty_mm, "mm");
    file.scalar<double>("largest_uncertainty", reference.largest_uncertainty_mm, "mm");
    file.scalar<int>("tetrahedra", reference.tetrahedra, "1");
    file.close();
    target.commit();
}

Reference read_reference(const std::filesystem::path& path) {
    const Hdf5Input file(path, format, version);
    return {file.columns<double>("displacement", 3), file.scalar<double>("uncertainty"),
            file.scalar<double>("largest_uncertainty"), file.scalar<int>("tetrahedra")};
}

}  // namespace tissuewarp::study
