#include "registration/matching/ultrasound/ultrasound_search.hpp"

#include "registration/springs/pull.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

UltrasoundSearch::UltrasoundSearch(const meshing::TetMesh& mesh, const imaging::Volume& moving, const SeenImage& fixed,
                                   EchoEngine& engine, const UltrasoundSearchOptions& options)
    : mesh_(mesh), engine_(engine), options_(options), source_(mesh, moving, fixed) {}

EchoCosts UltrasoundSearch::costs(const State& state, const EchoLevel& level) {
    const double reach_mm = (level.costs.reach + 1) * level.spacing_mm;
    return engine_.linear_combination(source_.on_grid(state, level.spacing_mm, reach_mm), level.costs);
}

EchoPose UltrasoundSearch::pose(const State& by_headers, Observer& observer) {
    const StructureCostOptions& structure = options_.structure;
    const double spacing_mm = options_.pose.spacing_mm / structure.step,
                 reach_mm = (structure.reach + 1) * options_.pose.spacing_mm;
    std::vector<PoseCosts> kinds;
    kinds.push_back({costs(by_headers, options_.pose)});
    kinds.push_back(
        {engine_.structure(source_.on_grid(by_headers, spacing_mm, reach_mm), structure), options_.structure_weight});
    return echo_pose(kinds, {}, observer);
}

DenseMatches UltrasoundSearch::matches(const State& state, int number, const meshing::PointLocator& locator) {
    const EchoLevel& level = options_.levels.at(std::min(static_cast<std::size_t>(number), options_.levels.size() - 1));
    const EchoCosts costs = this->costs(state, level);
    sought_ = static_cast<int>(costs.at.size());
    const EchoMatches echoes = echo_matches(costs, level.costs.window_mm);
    DenseMatches result{{}, echoes.agreement};
    LocatedMatches& found = result.found;
    found.matches.resize(echoes.forces.size());
    found.places.resize(echoes.forces.size());
    tbb::parallel_for(std::size_t{0}, echoes.forces.size(), [&](std::size_t n) {
        const auto place = locate_near(locator, echoes.forces[n].place);
        if (!place) return;
        found.places[n] = *place;
        found.matches[n] = as_match(echoes.forces[n], mesh_, state, *place);
    });
    found.drop_unlocated();
    return result;
}

}  // namespace tissuewarp::registration::detail
