#include "simulation/ablation.hpp"

#include "simulation/geometry.hpp"
#include "simulation/run.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace tissuewarp::simulation {

using Eigen::Matrix3Xd;

namespace {

template <class T>
void erase_at(std::vector<T>& list, std::size_t index) {
    list.erase(list.begin() + static_cast<std::ptrdiff_t>(index));
}

/// One entry for each member of a list of the scene.
template <class T, class Name>
void add_each(std::vector<Removable>& all, const Scene& scene, std::vector<T> Scene::*list, const Name& name) {
    for (std::size_t i = 0; i < (scene.*list).size(); ++i)
        all.push_back({name((scene.*list)[i], i), [list, i](Scene& without) { erase_at(without.*list, i); }});
}

struct Outcome {
    RunSummary summary;
    Matrix3Xd nodes, probes;
};

Outcome run(const Scene& scene, const meshing::TetMesh& mesh, Observer& observer) {
    const BuiltScene built = build(scene, mesh, observer);
    Outcome outcome;
    outcome.summary = simulate(
        built,
        [&](const Frame& frame) {
            if (frame.index < scene.solve.frames) return;
            outcome.nodes = on_scene_mesh(built, frame);
            outcome.probes = probe_displacements(built, frame);
        },
        observer);
    return outcome;
}

/// Mean and largest distance of columns that both have; nodes that a sliding interface adds come last.
std::pair<double, double> distance(const Matrix3Xd& a, const Matrix3Xd& b) {
    const Eigen::Index common = std::min(a.cols(), b.cols());
    double sum = 0, largest = 0;
    int count = 0;
    for (Eigen::Index n = 0; n < common; ++n) {
        const double difference = (a.col(n) - b.col(n)).norm();
        if (!std::isfinite(difference)) continue;  // gone in one of them
        sum += difference;
        largest = std::max(largest, difference);
        ++count;
    }
    return {count > 0 ? sum / count : 0.0, largest};
}

/// Progress of one of several runs.
class Share final : public Observer {
public:
    Share(Observer& whole, std::size_t index, std::size_t count) : whole_(whole), index_(index), count_(count) {}
    void progress(std::string_view stage, double fraction) override {
        if (stage == "simulation")
            whole_.progress(stage, (static_cast<double>(index_) + fraction) / static_cast<double>(count_));
    }
    bool cancel_requested() override { return whole_.cancel_requested(); }

private:
    Observer& whole_;
    std::size_t index_, count_;
};

Change change_without(const Removable& effect, const Scene& scene, const meshing::TetMesh& mesh, const Outcome& whole,
                      Observer& observer) {
    Change change;
    change.effect = effect.name;
    Scene without = scene;
    effect.remove(without);
    try {
        const Outcome outcome = run(without, mesh, observer);
        std::tie(change.probes_mean_mm, change.probes_max_mm) = distance(whole.probes, outcome.probes);
        std::tie(change.nodes_mean_mm, change.nodes_max_mm) = distance(whole.nodes, outcome.nodes);
        change.seconds = whole.summary.seconds - outcome.summary.seconds;
    } catch (const InvalidInput& error) {
        change.failure = error.what();
    } catch (const SolverFailure& error) {
        change.failure = error.what();
    }
    return change;
}

}  // namespace

std::vector<Removable> removable(const Scene& scene) {
    std::vector<Removable> all;
    const auto on = [](const std::string& what) {
        return [what](const auto& each, std::size_t) { return what + " '" + each.set + "'"; };
    };
    for (const auto& [label, tissue] : scene.tissues) {
        const int of = label;
        if (!tissue.viscosity.terms.empty())
            all.push_back({"viscosity of label " + std::to_string(of),
                           [of](Scene& without) { without.tissues[of].viscosity.terms.clear(); }});
        if (tissue.growth != 1.0)
            all.push_back(
                {"growth of label " + std::to_string(of), [of](Scene& without) { without.tissues[of].growth = 1.0; }});
    }
    add_each(all, scene, &Scene::motions, on("motion of"));
    add_each(all, scene, &Scene::springs, on("springs on"));
    if (scene.gravity)
        all.push_back({scene.fluid ? "gravity and fluid" : "gravity", [](Scene& without) {
                           without.gravity.reset();
                           without.fluid.reset();
                       }});
    if (scene.fluid) all.push_back({"fluid", [](Scene& without) { without.fluid.reset(); }});
    add_each(all, scene, &Scene::pressures, on("pressure on"));
    add_each(all, scene, &Scene::tractions, on("traction on"));
    add_each(all, scene, &Scene::membranes, on("membrane on"));
    add_each(all, scene, &Scene::contacts, [](const Contact& contact, std::size_t i) {
        return "contact " + std::to_string(i + 1) + (contact.set.empty() ? "" : " of '" + contact.set + "'");
    });
    add_each(all, scene, &Scene::sliding,
             [](const Sliding& sliding, std::size_t) { return "sliding of " + sides_of(sliding); });
    add_each(all, scene, &Scene::resections, on("resection of"));
    return all;
}

Ablation ablate(const Scene& scene, Observer& observer) {
    const std::vector<Removable> effects = removable(scene);
    Share first(observer, 0, effects.size() + 1);
    const meshing::TetMesh mesh = mesh_of(scene, first);
    const Outcome whole = run(scene, mesh, first);
    Ablation ablation;
    ablation.seconds = whole.summary.seconds;
    for (std::size_t e = 0; e < effects.size(); ++e) {
        Share share(observer, e + 1, effects.size() + 1);
        ablation.changes.push_back(change_without(effects[e], scene, mesh, whole, share));
    }
    return ablation;
}

}  // namespace tissuewarp::simulation
