#include "apps/bench_results.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissuewarp::apps {

double EngineTiming::mean() const {
    return std::accumulate(seconds_per_step.begin(), seconds_per_step.end(), 0.0) / double(seconds_per_step.size());
}

double EngineTiming::median() const {
    std::vector<double> sorted = seconds_per_step;
    std::sort(sorted.begin(), sorted.end());
    return (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2;
}

const EngineTiming* MeshTimings::of(BenchEngine engine) const {
    const auto found =
        std::find_if(engines.begin(), engines.end(), [&](const EngineTiming& each) { return each.engine == engine; });
    return found == engines.end() ? nullptr : &*found;
}

std::optional<double> MeshTimings::ratio_to_scalar(const EngineTiming& engine) const {
    const EngineTiming* scalar = of(BenchEngine::Scalar);
    if (scalar == nullptr) return std::nullopt;
    return scalar->median() / engine.median();
}

std::string name_of(Study study) {
    return study == Study::Cube ? "cube" : study == Study::Brain ? "brain" : "scaling";
}

std::optional<RealTimeLimit> real_time_limit(const std::vector<StudyResults>& studies, BenchEngine engine) {
    std::map<int, double> factor;  // by elements
    for (const StudyResults& study : studies)
        for (const MeshTimings& mesh : study.meshes)
            if (const EngineTiming* timing = mesh.of(engine); timing != nullptr && study.study != Study::Brain)
                factor[mesh.elements] = mesh.real_time_factor(*timing);
    if (factor.empty()) return std::nullopt;
    if (factor.begin()->second < 1) return RealTimeLimit{RealTimeLimit::Kind::Below, factor.begin()->first};
    for (auto at = factor.begin(); std::next(at) != factor.end(); ++at) {
        const auto after = std::next(at);
        if (after->second >= 1) continue;
        const double part = std::log(at->second) / std::log(at->second / after->second);
        const double elements = at->first * std::pow(double(after->first) / at->first, part);
        return RealTimeLimit{RealTimeLimit::Kind::Between, static_cast<int>(std::lround(elements))};
    }
    return RealTimeLimit{RealTimeLimit::Kind::Above, factor.rbegin()->first};
}

double BenchResults::bandwidth_share(const MeshTimings& mesh, const EngineTiming& engine) const {
    return engine.work.bytes * mesh.elements / engine.median() /
           ceilings.at(processor_of(engine.engine)).copy_bytes_per_second;
}

double BenchResults::fma_share(const MeshTimings& mesh, const EngineTiming& engine) const {
    return engine.work.flops * mesh.elements / engine.median() /
           ceilings.at(processor_of(engine.engine)).fma_flops_per_second;
}

}  // namespace tissuewarp::apps
