// Figures of the benchmark as SVG text: two panels side by side, logarithmic on both axes.

#include "apps/bench_outputs.hpp"

#include "report/figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

namespace tissuewarp::apps {

namespace {

using report::FigureCurve;
using report::LineStyle;
using report::Mark;

const char* colour_of(BenchEngine engine) {
    constexpr const char* colours[] = {"#6b7280", "#1d4ed8", "#c2410c", "#a21caf", "#047857"};
    return colours[static_cast<int>(engine)];
}

const char* label_of(BenchEngine engine) {
    constexpr const char* labels[] = {"scalar C++, 1 thread", "SIMD CPU", "render passes (2007)", "two compute passes",
                                      "fused patches"};
    return labels[static_cast<int>(engine)];
}

using Quantity = std::function<double(const MeshTimings&, const EngineTiming&)>;

/// One curve for each engine that has points; `skip` has none.
std::vector<FigureCurve> curves_of(const StudyResults& study, const Quantity& quantity,
                                   std::optional<BenchEngine> skip = std::nullopt) {
    std::vector<FigureCurve> curves;
    for (const BenchEngine engine : every_bench_engine) {
        FigureCurve curve{colour_of(engine)};
        for (const MeshTimings& mesh : study.meshes)
            if (const EngineTiming* timing = mesh.of(engine); timing != nullptr && engine != skip)
                curve.points.push_back({double(mesh.elements), quantity(mesh, *timing)});
        if (!curve.points.empty()) curves.push_back(curve);
    }
    return curves;
}

/// The step in simulated time: engines below it run in real time.
FigureCurve real_time(const StudyResults& study) {
    FigureCurve curve{"#111827", LineStyle::Dashed, Mark::None};
    for (const MeshTimings& mesh : study.meshes) curve.points.push_back({double(mesh.elements), mesh.time_step * 1e6});
    return curve;
}

std::vector<report::LegendEntry> legend(const StudyResults& study) {
    std::vector<report::LegendEntry> entries;
    for (const BenchEngine engine : every_bench_engine)
        if (std::any_of(study.meshes.begin(), study.meshes.end(), [&](const auto& mesh) { return mesh.of(engine); }))
            entries.push_back({{colour_of(engine), LineStyle::Solid, Mark::None}, label_of(engine)});
    entries.push_back({{"#111827", LineStyle::Dashed, Mark::None}, "step simulated"});
    return entries;
}

}  // namespace

std::string bench_figure(const StudyResults& study) {
    const char* scene = study.study == Study::Brain ? "indented brain" : "stretched cube";
    std::vector<FigureCurve> times =
        curves_of(study, [](const MeshTimings&, const EngineTiming& engine) { return engine.median() * 1e6; });
    times.push_back(real_time(study));
    const bool ratios =
        study.study != Study::Scaling && std::any_of(study.meshes.begin(), study.meshes.end(), [](const auto& mesh) {
            return mesh.of(BenchEngine::Scalar) != nullptr && mesh.engines.size() > 1;
        });
    const std::vector<FigureCurve> beside =
        ratios ? curves_of(
                     study,
                     [](const MeshTimings& mesh, const EngineTiming& engine) {
                         return mesh.ratio_to_scalar(engine).value_or(1);
                     },
                     BenchEngine::Scalar)
               : curves_of(study, [](const MeshTimings& mesh, const EngineTiming& engine) {
                     return engine.median() / mesh.elements * 1e9;
                 });
    std::vector<report::FigurePanel> panels(2);  // member by member: GCC 12 warns of uninitialised strings otherwise
    panels[0].title = fmt::format("Time per step, {}", scene);
    panels[0].y.label = "µs per step";
    panels[0].curves = times;
    panels[1].left = 570;
    panels[1].title = ratios ? "Times faster than scalar C++" : "Time per element and step";
    panels[1].y.label = ratios ? "ratio" : "ns per element-step";
    panels[1].curves = beside;
    for (report::FigurePanel& panel : panels) panel.x.label = "tetrahedra";
    return report::svg_figure(legend(study), panels);
}

}  // namespace tissuewarp::apps
