#include "simulation/coarse_start.hpp"

#include "core/errors.hpp"
#include "simulation/loads.hpp"

#include <algorithm>
#include <array>
#include <type_traits>
#include <utility>

namespace tissuewarp::simulation {

using Eigen::Matrix3Xd;

namespace {

void coarsen(BoxGeometry& box) {
    for (int& cells : box.cells) cells = std::max(1, (cells + 1) / 2);
}

template <class Meshed>
void coarsen(Meshed& meshed) {
    meshed.edge_length *= 2;
    for (auto& [label, edge] : meshed.label_edge_length) edge *= 2;
}

/// What it finds is a start: notes of how are not those of the answer.
class Quiet final : public Observer {
public:
    explicit Quiet(Observer& whole) : whole_(whole) {}
    void note(std::string_view) override {}
    bool cancel_requested() override { return whole_.cancel_requested(); }

private:
    Observer& whole_;
};

tled::EquilibriumResult equilibrium_of(const BuiltScene& built, double time, Observer& observer) {
    const Stage& stage = built.stages.front();
    LoadsInTime loads(built, stage, stage.begin);
    const tled::NodalConditions& conditions = loads.at(time);
    const tled::RestStiffness stiffness(stage.rest, conditions);
    const auto engine = tled::make_cpu_engine(stage.rest, tled::Scalar::Float32);
    tled::LoadPathOptions options;
    options.equilibrium.tolerance_mm = built.scene.solve.tolerance_mm;
    options.equilibrium.rest = &stage.rest;
    options.coarse_start = [&] { return coarse_start(built, time, observer); };
    return tled::equilibrium_along_load_or_motion(*engine, stiffness, conditions, options, nullptr, observer);
}

}  // namespace

std::optional<Scene> coarser(const Scene& scene, int tetrahedra) {
    constexpr int fewest = 10000;
    if (tetrahedra < fewest || !scene.sliding.empty() || !scene.contacts.empty() || !scene.resections.empty() ||
        std::holds_alternative<meshing::TetMesh>(scene.geometry))
        return std::nullopt;
    Scene coarse = scene;
    coarse.probes.clear();
    std::visit(
        [](auto& geometry) {
            if constexpr (!std::is_same_v<std::decay_t<decltype(geometry)>, meshing::TetMesh>) coarsen(geometry);
        },
        coarse.geometry);
    return coarse;
}

std::optional<Matrix3Xd> carried_on(const meshing::TetMesh& mesh, const Matrix3Xd& displacement,
                                    const Matrix3Xd& places) {
    constexpr std::array<double, 4> outside{1e-9, 0.1, 0.3, 1.0};  // in barycentric coordinates
    const meshing::PointLocator locator(mesh);
    Matrix3Xd result(3, places.cols());
    for (Eigen::Index p = 0; p < places.cols(); ++p) {
        std::optional<meshing::Location> at;
        for (const double tolerance : outside)
            if (!at) at = locator.find(places.col(p), tolerance);
        if (!at) return std::nullopt;
        result.col(p) = meshing::interpolate(mesh, displacement, *at);
    }
    return result;
}

std::optional<tled::CoarseStart> coarse_start(const BuiltScene& built, double time, Observer& observer) {
    const Stage& stage = built.stages.front();
    const std::optional<Scene> scene = coarser(built.scene, stage.rest.element_count());
    if (!scene) return std::nullopt;
    Quiet quiet(observer);
    try {
        const BuiltScene coarse = build(*scene, quiet);
        const meshing::TetMesh& mesh = coarse.stages.front().model.mesh;
        const tled::EquilibriumResult found = equilibrium_of(coarse, time, quiet);
        if (auto carried = carried_on(mesh, found.displacement, stage.rest.position))
            return tled::CoarseStart{std::move(*carried), found.method};
    } catch (const InvalidInput&) {
    } catch (const SolverFailure&) {
    }
    return std::nullopt;
}

}  // namespace tissuewarp::simulation
