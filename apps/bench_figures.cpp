// Figures of the benchmark as SVG text: two panels side by side, logarithmic on both axes.

#include "apps/bench_outputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

namespace tissuewarp::apps {

namespace {

struct Point {
    double x, y;
};
struct Curve {
    std::string colour;
    bool dashed = false;
    std::vector<Point> points;
};

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

std::string text(double x, double y, const std::string& content, const char* anchor = "middle",
                 const std::string& more = "") {
    return fmt::format(
        "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"12\" text-anchor=\"{}\" font-family=\"sans-serif\" "
        "fill=\"#111827\"{}>{}</text>\n",
        x, y, anchor, more, content);
}

std::string line(Point from, Point to, const char* colour, const char* more = "") {
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"{}/>\n", from.x,
                       from.y, to.x, to.y, colour, more);
}

/// 6 000, 0.01, 1e7 becomes 10 000 000.
std::string number_text(double value) {
    std::string digits = value < 1 ? fmt::format("{:g}", value) : fmt::format("{:.0f}", value);
    if (value >= 10000)
        for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3)
            digits.insert(static_cast<std::size_t>(at), "\u202f");
    return digits;
}

/// Where ticks stand on an axis from `low` to `high`: decades, and 2 and 5 between where there are few of them.
std::vector<double> ticks(double low, double high) {
    const bool few = high / low < 200;
    std::vector<double> result;
    for (double decade = std::pow(10.0, std::floor(std::log10(low))); decade <= high; decade *= 10)
        for (const double digit : {1.0, 2.0, 5.0})
            if (const double tick = digit * decade; (few || digit == 1.0) && tick >= low && tick <= high)
                result.push_back(tick);
    return result;
}

/// A panel whose axes hold all curves.
class Panel {
public:
    Panel(double left, const std::vector<Curve>& curves) : left_(left) {
        for (const Curve& curve : curves)
            for (const Point& p : curve.points) {
                low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y)};
                high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y)};
            }
        low_ = {low_.x / 1.3, low_.y / 1.5};
        high_ = {high_.x * 1.3, high_.y * 1.5};
    }

    [[nodiscard]] std::string drawn(const std::string& title, const std::string& y_label,
                                    const std::vector<Curve>& curves) const {
        std::string svg = text(left_ + panel_width / 2, top - 10, title, "middle", " font-weight=\"bold\"");
        for (const double tick : ticks(low_.x, high_.x)) {
            const double x = at({tick, low_.y}).x;
            svg += line({x, top}, {x, top + panel_height}, "#e5e7eb") +
                   text(x, top + panel_height + 17, number_text(tick));
        }
        for (const double tick : ticks(low_.y, high_.y)) {
            const double y = at({low_.x, tick}).y;
            svg += line({left_, y}, {left_ + panel_width, y}, "#e5e7eb") +
                   text(left_ - 6, y + 4, number_text(tick), "end");
        }
        svg += fmt::format(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
            "stroke=\"#9ca3af\"/>\n",
            left_, top, panel_width, panel_height);
        svg += text(left_ + panel_width / 2, top + panel_height + 38, "tetrahedra");
        const double x = left_ - 58, y = top + panel_height / 2;
        svg += text(x, y, y_label, "middle", fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", x, y));
        for (const Curve& curve : curves) svg += drawn(curve);
        return svg;
    }

private:
    static constexpr double top = 70, panel_width = 380, panel_height = 300;

    [[nodiscard]] Point at(Point p) const {
        return {left_ + panel_width * std::log(p.x / low_.x) / std::log(high_.x / low_.x),
                top + panel_height * std::log(high_.y / p.y) / std::log(high_.y / low_.y)};
    }

    [[nodiscard]] std::string drawn(const Curve& curve) const {
        std::string path, marks;
        for (const Point& p : curve.points) {
            const Point q = at(p);
            path += fmt::format("{:.1f},{:.1f} ", q.x, q.y);
            if (!curve.dashed)
                marks +=
                    fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n", q.x, q.y, curve.colour);
        }
        return fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"{}/>\n", path,
                           curve.colour, curve.dashed ? " stroke-dasharray=\"6 4\"" : "") +
               marks;
    }

    double left_;
    Point low_{std::numeric_limits<double>::max(), std::numeric_limits<double>::max()};
    Point high_{0, 0};
};

using Quantity = std::function<double(const MeshTimings&, const EngineTiming&)>;

/// One curve for each engine that has points; `skip` has none.
std::vector<Curve> curves_of(const StudyResults& study, const Quantity& quantity,
                             std::optional<BenchEngine> skip = std::nullopt) {
    std::vector<Curve> curves;
    for (const BenchEngine engine : every_bench_engine) {
        Curve curve{colour_of(engine), false, {}};
        for (const MeshTimings& mesh : study.meshes)
            if (const EngineTiming* timing = mesh.of(engine); timing != nullptr && engine != skip)
                curve.points.push_back({double(mesh.elements), quantity(mesh, *timing)});
        if (!curve.points.empty()) curves.push_back(curve);
    }
    return curves;
}

/// The step in simulated time: engines below it run in real time.
Curve real_time(const StudyResults& study) {
    Curve curve{"#111827", true, {}};
    for (const MeshTimings& mesh : study.meshes) curve.points.push_back({double(mesh.elements), mesh.time_step * 1e6});
    return curve;
}

std::string legend(const StudyResults& study) {
    std::string svg;
    double x = 40;
    const auto entry = [&](const char* colour, const std::string& label, const char* more) {
        svg += line({x, 26}, {x + 22, 26}, colour, more) + text(x + 28, 30, label, "start");
        x += 50 + 6.2 * double(label.size());
    };
    for (const BenchEngine engine : every_bench_engine)
        if (std::any_of(study.meshes.begin(), study.meshes.end(), [&](const auto& mesh) { return mesh.of(engine); }))
            entry(colour_of(engine), label_of(engine), " stroke-width=\"2\"");
    entry("#111827", "step simulated", " stroke-width=\"2\" stroke-dasharray=\"6 4\"");
    return svg;
}

}  // namespace

std::string bench_figure(const StudyResults& study) {
    const char* scene = study.study == Study::Brain ? "indented brain" : "stretched cube";
    std::vector<Curve> times =
        curves_of(study, [](const MeshTimings&, const EngineTiming& engine) { return engine.median() * 1e6; });
    times.push_back(real_time(study));
    const bool ratios =
        study.study != Study::Scaling && std::any_of(study.meshes.begin(), study.meshes.end(), [](const auto& mesh) {
            return mesh.of(BenchEngine::Scalar) != nullptr && mesh.engines.size() > 1;
        });
    const std::vector<Curve> beside = ratios
                                          ? curves_of(
                                                study,
                                                [](const MeshTimings& mesh, const EngineTiming& engine) {
                                                    return mesh.ratio_to_scalar(engine).value_or(1);
                                                },
                                                BenchEngine::Scalar)
                                          : curves_of(study, [](const MeshTimings& mesh, const EngineTiming& engine) {
                                                return engine.median() / mesh.elements * 1e9;
                                            });
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
        "height=\"{1}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        width, height);
    svg += legend(study);
    svg += Panel(90, times).drawn(fmt::format("Time per step, {}", scene), "µs per step", times);
    svg += ratios ? Panel(570, beside).drawn("Times faster than scalar C++", "ratio", beside)
                  : Panel(570, beside).drawn("Time per element and step", "ns per element-step", beside);
    return svg + "</svg>\n";
}

}  // namespace tissuewarp::apps
