#include "registration/matching/dense/dense_search.hpp"

#include "registration/springs/pull.hpp"

#include <Eigen/LU>

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

/// ∂x/∂X of an element, its placement included.
Eigen::Matrix3d deformation_gradient(const meshing::TetMesh& mesh, const State& state, int tet) {
    const Eigen::Matrix<double, 3, 4> X = mesh.nodes(Eigen::all, mesh.tets.col(tet)),
                                      x = X + state.displacement(Eigen::all, mesh.tets.col(tet));
    const Eigen::Matrix3d rest = X.rightCols<3>().colwise() - X.col(0),
                          deformed = x.rightCols<3>().colwise() - x.col(0);
    return state.placement.linear() * deformed * rest.inverse();
}

}  // namespace

BlockMatch as_match(const DenseForce& force, const meshing::TetMesh& mesh, const State& state,
                    const meshing::Location& at) {
    const Eigen::Matrix3d F = deformation_gradient(mesh, state, at.tet), back = F.inverse();
    BlockMatch match;
    match.moving = force.place;
    match.fixed = state.placement * (force.place + displacement_at(mesh, state.displacement, at)) + F * force.shift;
    match.confidence = 1;
    match.information = back.transpose() * force.information * back;
    return match;
}

DenseSearch::DenseSearch(const meshing::TetMesh& mesh, const ImageModel& image, ImageEngine& engine)
    : mesh_(mesh), image_(image), engine_(engine) {}

DenseMatches DenseSearch::matches(const State& state, int coarsening, const LocatedMatches& known,
                                  const meshing::PointLocator& locator) const {
    const int finest = image_.blocks.options().levels - 1;
    const DenseForces dense = engine_.forces(state, static_cast<std::size_t>(std::max(0, finest - coarsening)));
    DenseMatches result{{}, dense.agreement};
    LocatedMatches& found = result.found;
    found.reserve(dense.forces.size() + known.matches.size());
    found.matches.resize(dense.forces.size());
    found.places.resize(dense.forces.size());
    tbb::parallel_for(std::size_t{0}, dense.forces.size(), [&](std::size_t n) {
        const auto place = locate_near(locator, dense.forces[n].place);
        if (!place) return;
        found.places[n] = *place;
        found.matches[n] = as_match(dense.forces[n], mesh_, state, *place);
    });
    found.drop_unlocated();
    for (std::size_t n = 0; n < known.matches.size(); ++n)
        if (!dense.say_something_at(known.matches[n].moving)) found.add(known.matches[n], known.places[n]);
    return result;
}

}  // namespace tissuewarp::registration::detail
