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
using report::LogPanel;
using report::Mark;

constexpr double width = 980, height = 430;

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

std::string legend(const StudyResults& study) {
    std::string svg;
    double x = 40;
    const auto entry = [&](const FigureCurve& curve, const std::string& label) {
        svg += report::svg_legend_entry({x, 26}, curve, label);
        x += report::legend_width(label);
    };
    for (const BenchEngine engine : every_bench_engine)
        if (std::any_of(study.meshes.begin(), study.meshes.end(), [&](const auto& mesh) { return mesh.of(engine); }))
            entry({colour_of(engine), LineStyle::Solid, Mark::None}, label_of(engine));
    entry({"#111827", LineStyle::Dashed, Mark::None}, "step simulated");
    return svg;
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
    const LogPanel left({.left = 90}, times), right({.left = 570}, beside);
    return report::svg_figure(
        width, height,
        legend(study) + left.drawn(fmt::format("Time per step, {}", scene), "tetrahedra", "µs per step", times) +
            (ratios ? right.drawn("Times faster than scalar C++", "tetrahedra", "ratio", beside)
                    : right.drawn("Time per element and step", "tetrahedra", "ns per element-step", beside)));
}

}  // namespace tissuewarp::apps
