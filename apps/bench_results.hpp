#pragma once
/// What the benchmark measured, and what follows from it. Times in s.

#include "apps/bench_engines.hpp"
#include "shaders/ceilings.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// Accepted difference to float64, over the largest displacement.
inline constexpr double accepted_difference = 1e-4;

/// One engine on one mesh.
struct EngineTiming {
    BenchEngine engine = BenchEngine::Scalar;
    std::string description;
    int steps = 0;                         ///< of each run
    std::vector<double> seconds_per_step;  ///< of each run
    tled::StepWork work;
    std::optional<tled::GpuStepShape> shape;  ///< of compute passes and patches
    bool repeats_equal = true;                ///< all runs ended in the same bits
    int compared_steps = 0;                   ///< 0: not compared
    std::optional<double>
        difference;  ///< to float64 after compared_steps, over the largest displacement; NaN: blown up

    [[nodiscard]] double mean() const;
    [[nodiscard]] double median() const;
    [[nodiscard]] bool correct() const { return repeats_equal && (!difference || *difference < accepted_difference); }
};

struct MeshTimings {
    int elements = 0, nodes = 0;
    double critical_step = 0;
    double time_step = 0;  ///< 0.9 of it: what the runs take
    std::vector<EngineTiming> engines;

    [[nodiscard]] const EngineTiming* of(BenchEngine engine) const;
    /// Times the step of `engine` fits into that of the scalar loops; nothing where these were not run.
    [[nodiscard]] std::optional<double> ratio_to_scalar(const EngineTiming& engine) const;
    /// Simulated over elapsed time.
    [[nodiscard]] double real_time_factor(const EngineTiming& engine) const { return time_step / engine.median(); }
};

enum class Study { Cube, Brain, Scaling };
std::string name_of(Study study);

struct StudyResults {
    Study study = Study::Cube;
    std::vector<MeshTimings> meshes;  ///< by rising number of elements
};

/// Where an engine's real-time factor falls below 1.
struct RealTimeLimit {
    enum class Kind {
        Below,
        Between,
        Above
    } kind = Kind::Between;  ///< the smallest mesh, two meshes, the largest mesh
    int elements = 0;        ///< the smallest, the interpolated, the largest
};
/// By interpolation of the cubes of all studies, both axes logarithmic; nothing without meshes of that engine.
std::optional<RealTimeLimit> real_time_limit(const std::vector<StudyResults>& studies, BenchEngine engine);

struct BenchResults {
    std::string cpu;  ///< description of the SIMD engine
    std::optional<BenchDevice> device;
    std::map<tled::Processor, shaders::Ceilings> ceilings;
    std::vector<StudyResults> studies;
    int repeats = 0;
    std::vector<std::string> notes;

    /// Shares of the ceilings of the engine's processor that its median step reaches by the model of its work.
    [[nodiscard]] double bandwidth_share(const MeshTimings& mesh, const EngineTiming& engine) const;
    [[nodiscard]] double fma_share(const MeshTimings& mesh, const EngineTiming& engine) const;
};

}  // namespace tissuewarp::apps
