// Three panels: estimated against true deviations, nominal against actual shares, and the phantoms one by one.

#include "report/figure.hpp"
#include "study/coverage_summary.hpp"

namespace tissuewarp::study {

namespace {

using report::FigureCurve;
using report::FigurePanel;
using report::LineStyle;
using report::Mark;
using report::Scale;

FigureCurve curve_of(const Coverage& coverage) {
    constexpr std::array<const char*, all_evidence.size()> colours{
        "#1d4ed8", "#c2410c", "#047857", "#a21caf", "#0e7490", "#111827", "#b91c1c", "#a16207", "#6d28d9", "#4d7c0f"};
    return {colours[static_cast<std::size_t>(coverage.evidence)]};
}

std::string label_of(const Coverage& c) {
    constexpr std::array<const char*, all_evidence.size()> words{
        "labels", "part of the surface", "surface and points", "points alone",   "vessels",
        "image",  "degraded image",      "part of an image",   "other contrast", "ultrasound"};
    return std::string(words[static_cast<std::size_t>(c.evidence)]) + (c.in_view ? "" : ", unseen") + " (" +
           std::to_string(c.phantoms) + " phantoms" + (c.unknown_share < 1 ? ")" : ", not trusted)");
}

/// Where both axes agree.
FigureCurve diagonal(double low, double high) {
    return {"#111827", LineStyle::Dashed, Mark::None, {{low, low}, {high, high}}, 1};
}

/// A square, the first, second or third.
FigurePanel square(int place, const char* title, report::FigureAxis x, report::FigureAxis y) {
    return {.left = 72.0 + 358 * place,
            .top = 68,
            .width = 270,
            .height = 270,
            .title = title,
            .x = std::move(x),
            .y = std::move(y),
            .curves = {}};
}

FigurePanel reliability(const std::vector<Coverage>& coverage) {
    constexpr std::pair ends{0.2, 20.0};
    FigurePanel panel = square(0, "Is an estimate of 1 mm 1 mm?", {"estimated deviation, mm", Scale::Logarithmic, ends},
                               {"true error, root mean square, mm", Scale::Logarithmic, ends});
    panel.curves.push_back(diagonal(ends.first, ends.second));
    for (const Coverage& c : coverage) {
        FigureCurve& curve = panel.curves.emplace_back(curve_of(c));
        for (const ReliabilityBin& bin : c.bins) curve.points.push_back({bin.estimated_mm, bin.true_mm});
    }
    return panel;
}

FigurePanel shares(const std::vector<Coverage>& coverage) {
    constexpr std::pair ends{20.0, 100.0};
    FigurePanel panel = square(1, "Do intervals hold?", {"probability stated, %", Scale::Linear, ends},
                               {"targets within, %", Scale::Linear, ends});
    const FigureCurve wanted{"#c3c5c9", LineStyle::Solid, Mark::None, {{95, 92}, {95, 98}}, 5};
    panel.curves = {diagonal(ends.first, ends.second), wanted};
    for (const Coverage& c : coverage) {
        FigureCurve& curve = panel.curves.emplace_back(curve_of(c));
        for (std::size_t level = 0; level < nominal_shares.size(); ++level)
            curve.points.push_back({100 * nominal_shares[level], 100 * c.held[level]});
    }
    return panel;
}

FigurePanel phantoms(const std::vector<Coverage>& coverage) {
    constexpr std::pair ends{0.0, 100.0};
    FigurePanel panel = square(2, "One phantom at a time", {"phantoms, %, from the worst on", Scale::Linear, ends},
                               {"targets within their 95 % interval, %", Scale::Linear, ends});
    for (const Coverage& c : coverage) {
        FigureCurve& curve = panel.curves.emplace_back(curve_of(c));
        curve.mark = Mark::None;
        const double count = double(c.phantom_shares.size());
        for (std::size_t k = 0; k < c.phantom_shares.size(); ++k)
            curve.points.push_back({100 * (double(k) + 0.5) / count, 100 * c.phantom_shares[k]});
    }
    return panel;
}

}  // namespace

std::string coverage_figure(const std::vector<Coverage>& coverage) {
    std::vector<report::LegendEntry> legend;
    for (const Coverage& c : coverage) legend.push_back({curve_of(c), label_of(c)});
    return report::svg_figure(legend, {reliability(coverage), shares(coverage), phantoms(coverage)});
}

}  // namespace tissuewarp::study
