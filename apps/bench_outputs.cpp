#include "apps/bench_outputs.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tissuewarp::apps {

namespace {

std::string ratio_text(const std::optional<double>& ratio) {
    return ratio ? fmt::format("{:.1f}", *ratio) : "-";
}

std::string difference_text(const EngineTiming& engine) {
    const std::string difference = engine.difference ? fmt::format("{:.1e}", *engine.difference) : "-";
    return difference + (engine.repeats_equal ? "" : " NOT REPEATED");
}

/// Of patches: two passes have but one shape.
std::string shape_text(const EngineTiming& engine) {
    if (engine.engine != BenchEngine::Fused || !engine.shape) return "";
    return "  " + name_of(*engine.shape);
}

nlohmann::json shape_json(const EngineTiming& engine) {
    if (engine.engine != BenchEngine::Fused || !engine.shape) return {};
    const tled::GpuStepShape& shape = *engine.shape;
    return {{"patch_tets", shape.patch_tets},
            {"longest_fan", shape.longest_fan},
            {"workgroup", shape.workgroup},
            {"at_once", shape.at_once}};
}

void print_ceilings(const BenchResults& results) {
    for (const auto& [processor, c] : results.ceilings)
        fmt::print("{}: copy {:.1f} GB/s, multiply-adds {:.1f} Gflop/s\n",
                   processor == tled::Processor::Cpu ? results.cpu : results.device->name,
                   c.copy_bytes_per_second * 1e-9, c.fma_flops_per_second * 1e-9);
}

void print_row(const BenchResults& results, const MeshTimings& mesh, const EngineTiming& engine) {
    fmt::print(
        "{:>9}  {:<14}{:>11.2f}{:>11.2f}{:>8}{:>10.3f}{:>7.0f}{:>7.0f}{:>8.1f}{:>8.1f}{:>12.2f}{:>10.3g}  {}{}\n",
        mesh.elements, name_of(engine.engine), engine.mean() * 1e6, engine.median() * 1e6,
        ratio_text(mesh.ratio_to_scalar(engine)), engine.median() / mesh.elements * 1e9, engine.work.bytes,
        engine.work.flops, 100 * results.bandwidth_share(mesh, engine), 100 * results.fma_share(mesh, engine),
        mesh.critical_step * 1e6, mesh.real_time_factor(engine), difference_text(engine), shape_text(engine));
}

std::string limit_text(const RealTimeLimit& limit) {
    const char* how = limit.kind == RealTimeLimit::Kind::Below   ? "less than "
                      : limit.kind == RealTimeLimit::Kind::Above ? "more than "
                                                                 : "";
    return fmt::format("{}{}", how, limit.elements);
}

nlohmann::json number_or_null(double value) {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

nlohmann::json to_json(const BenchResults& results, const MeshTimings& mesh, const EngineTiming& engine) {
    const std::optional<double> ratio = mesh.ratio_to_scalar(engine);
    return {{"engine", name_of(engine.engine)},
            {"description", engine.description},
            {"step_shape", shape_json(engine)},
            {"steps", engine.steps},
            {"seconds_per_step", engine.seconds_per_step},
            {"mean_seconds_per_step", engine.mean()},
            {"median_seconds_per_step", engine.median()},
            {"ratio_to_scalar", ratio ? nlohmann::json(*ratio) : nlohmann::json()},
            {"nanoseconds_per_element_step", engine.median() / mesh.elements * 1e9},
            {"bytes_per_element_step", engine.work.bytes},
            {"flops_per_element_step", engine.work.flops},
            {"copy_bandwidth_share", results.bandwidth_share(mesh, engine)},
            {"fma_rate_share", results.fma_share(mesh, engine)},
            {"real_time_factor", mesh.real_time_factor(engine)},
            {"compared_steps", engine.compared_steps},
            {"relative_difference", engine.difference ? number_or_null(*engine.difference) : nlohmann::json()},
            {"repeats_equal", engine.repeats_equal},
            {"correct", engine.correct()}};
}

nlohmann::json to_json(const BenchResults& results, const StudyResults& study) {
    nlohmann::json meshes = nlohmann::json::array();
    for (const MeshTimings& mesh : study.meshes) {
        nlohmann::json engines = nlohmann::json::array();
        for (const EngineTiming& engine : mesh.engines) engines.push_back(to_json(results, mesh, engine));
        meshes.push_back({{"elements", mesh.elements},
                          {"nodes", mesh.nodes},
                          {"critical_step_seconds", mesh.critical_step},
                          {"time_step_seconds", mesh.time_step},
                          {"engines", engines}});
    }
    return {{"study", name_of(study.study)}, {"meshes", meshes}};
}

}  // namespace

void print_head(const BenchResults& results) {
    fmt::print("time per step: mean and median of {} runs; ratio: median of the scalar loops over the engine's\n",
               results.repeats);
    print_ceilings(results);
    std::fflush(stdout);
}

void print_study(const BenchResults& results, const StudyResults& study) {
    fmt::print("\n{}\n{:>9}  {:<14}{:>11}{:>11}{:>8}{:>10}{:>7}{:>7}{:>8}{:>8}{:>12}{:>10}  {}\n", name_of(study.study),
               "elements", "engine", "mean us", "median us", "ratio", "ns/el", "B/el", "op/el", "copy %", "fma %",
               "critical us", "real time", "difference");
    for (const MeshTimings& mesh : study.meshes)
        for (const EngineTiming& engine : mesh.engines) print_row(results, mesh, engine);
    std::fflush(stdout);
}

void print_limits(const BenchResults& results) {
    fmt::print("\n");
    for (const BenchEngine engine : every_bench_engine)
        if (const auto limit = real_time_limit(results.studies, engine))
            fmt::print("largest cube in real time, {}: {} elements\n", name_of(engine), limit_text(*limit));
    for (const std::string& note : results.notes) fmt::print("note: {}\n", note);
}

nlohmann::json bench_json(const BenchResults& results) {
    nlohmann::json ceilings = nlohmann::json::object();
    for (const auto& [processor, c] : results.ceilings)
        ceilings[processor == tled::Processor::Cpu ? "cpu" : "gpu"] = {
            {"copy_bytes_per_second", c.copy_bytes_per_second}, {"fma_flops_per_second", c.fma_flops_per_second}};
    nlohmann::json studies = nlohmann::json::array(), limits = nlohmann::json::object();
    for (const StudyResults& study : results.studies) studies.push_back(to_json(results, study));
    for (const BenchEngine engine : every_bench_engine)
        if (const auto limit = real_time_limit(results.studies, engine)) {
            constexpr const char* kinds[] = {"below", "interpolated", "above"};
            limits[name_of(engine)] = {{"kind", kinds[static_cast<int>(limit->kind)]}, {"elements", limit->elements}};
        }
    nlohmann::json gpu;
    if (results.device) gpu = {{"name", results.device->name}, {"hardware", results.device->hardware}};
    return {{"schema", "tissuewarp.bench"},
            {"schema_version", 1},
            {"cpu", results.cpu},
            {"gpu", gpu},
            {"repeats", results.repeats},
            {"accepted_difference", accepted_difference},
            {"ceilings", ceilings},
            {"studies", studies},
            {"largest_real_time_cube", limits},
            {"notes", results.notes}};
}

std::string bench_csv(const BenchResults& results) {
    std::string text =
        "study,elements,nodes,engine,steps,mean_s,median_s,ratio_to_scalar,ns_per_element_step,bytes_per_element_step,"
        "flops_per_element_step,copy_bandwidth_share,fma_rate_share,critical_step_s,real_time_factor,"
        "relative_difference,repeats_equal\n";
    const auto optional_text = [](const std::optional<double>& value) {
        return value ? fmt::format("{:.6g}", *value) : std::string();
    };
    for (const StudyResults& study : results.studies)
        for (const MeshTimings& mesh : study.meshes)
            for (const EngineTiming& engine : mesh.engines)
                text += fmt::format(
                    "{},{},{},{},{},{:.6g},{:.6g},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{},{}\n",
                    name_of(study.study), mesh.elements, mesh.nodes, name_of(engine.engine), engine.steps,
                    engine.mean(), engine.median(), optional_text(mesh.ratio_to_scalar(engine)),
                    engine.median() / mesh.elements * 1e9, engine.work.bytes, engine.work.flops,
                    results.bandwidth_share(mesh, engine), results.fma_share(mesh, engine), mesh.critical_step,
                    mesh.real_time_factor(engine), optional_text(engine.difference), engine.repeats_equal ? 1 : 0);
    return text;
}

}  // namespace tissuewarp::apps
