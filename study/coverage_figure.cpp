// Three panels: estimated against true deviations, nominal against actual shares, and the phantoms one by one.

#include "report/figure.hpp"
#include "study/coverage_summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

namespace tissuewarp::study {

namespace {

constexpr double width = 1080, height = 400, panel = 270, left = 62, top = 46, gap = 78;

const char* colour_of(Evidence evidence) {
    constexpr std::array colours{"#1d4ed8", "#c2410c", "#047857", "#a21caf"};
    return colours[static_cast<std::size_t>(evidence)];
}

const char* words_for(Evidence evidence) {
    constexpr std::array words{"labels", "part of the surface", "surface and points", "points alone"};
    return words[static_cast<std::size_t>(evidence)];
}

using Point = report::FigurePoint;

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", value);
    return text;
}

std::string label(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", value);
    return text;
}

std::string path(const std::vector<Point>& points, const std::string& style) {
    std::string d;
    for (const Point& point : points) d += (d.empty() ? "M" : " L") + number(point.x) + " " + number(point.y);
    return "<path d=\"" + d + "\" fill=\"none\" " + style + "/>\n";
}

/// A square with axes from `low` to `high` on both sides, straight or logarithmic.
class Panel {
public:
    Panel(int place, double low, double high, bool logarithmic)
        : x_(left + place * (panel + gap)), low_(low), high_(high), logarithmic_(logarithmic) {}

    [[nodiscard]] Point at(double x, double y) const { return {x_ + panel * share(x), top + panel * (1 - share(y))}; }
    [[nodiscard]] std::string frame(const std::string& title, const std::string& x_name, const std::string& y_name,
                                    const std::vector<double>& ticks) const {
        std::string svg = "<rect x=\"" + number(x_) + "\" y=\"" + number(top) + "\" width=\"" + number(panel) +
                          "\" height=\"" + number(panel) + "\" fill=\"none\" stroke=\"#9ca3af\"/>\n";
        for (const double tick : ticks) {
            const Point across = at(tick, low_), up = at(low_, tick);
            svg += path({at(tick, low_), at(tick, high_)}, "stroke=\"#e5e7eb\"");
            svg += path({at(low_, tick), at(high_, tick)}, "stroke=\"#e5e7eb\"");
            svg += report::svg_text({across.x, across.y + 16}, label(tick));
            svg += report::svg_text({up.x - 6, up.y + 4}, label(tick), "end");
        }
        svg += report::svg_text({x_ + panel / 2, top - 14}, title, "middle", " font-weight=\"bold\"");
        svg += report::svg_text({x_ + panel / 2, top + panel + 36}, x_name);
        const Point side{x_ - 38, top + panel / 2};
        return svg + report::svg_text(side, y_name, "middle",
                                      " transform=\"rotate(-90 " + number(side.x) + " " + number(side.y) + ")\"");
    }

private:
    [[nodiscard]] double share(double value) const {
        const double bounded = std::clamp(value, low_, high_);
        return logarithmic_ ? std::log(bounded / low_) / std::log(high_ / low_) : (bounded - low_) / (high_ - low_);
    }
    double x_, low_, high_;
    bool logarithmic_;
};

std::string dots(const std::vector<Point>& points, const char* colour) {
    std::string svg;
    for (const Point& point : points)
        svg += "<circle cx=\"" + number(point.x) + "\" cy=\"" + number(point.y) + "\" r=\"3.2\" fill=\"" + colour +
               "\"/>\n";
    return svg;
}

std::string reliability(const std::vector<Coverage>& coverage) {
    const Panel axes(0, 0.2, 20, true);
    std::string svg = axes.frame("Is an estimate of 1 mm 1 mm?", "estimated deviation, mm",
                                 "true error, root mean square, mm", {0.2, 0.5, 1, 2, 5, 10, 20});
    svg += path({axes.at(0.2, 0.2), axes.at(20, 20)}, "stroke=\"#111827\" stroke-dasharray=\"4 3\"");
    for (const Coverage& c : coverage) {
        std::vector<Point> points;
        for (const ReliabilityBin& bin : c.bins) points.push_back(axes.at(bin.estimated_mm, bin.true_mm));
        svg += path(points, std::string("stroke-width=\"1.6\" stroke=\"") + colour_of(c.evidence) + "\"");
        svg += dots(points, colour_of(c.evidence));
    }
    return svg;
}

std::string shares(const std::vector<Coverage>& coverage) {
    const Panel axes(1, 20, 100, false);
    std::string svg =
        axes.frame("Do intervals hold?", "probability stated, %", "targets within, %", {20, 40, 60, 80, 100});
    svg += path({axes.at(20, 20), axes.at(100, 100)}, "stroke=\"#111827\" stroke-dasharray=\"4 3\"");
    svg += path({axes.at(95, 92), axes.at(95, 98)}, "stroke=\"#111827\" stroke-width=\"5\" stroke-opacity=\"0.25\"");
    for (const Coverage& c : coverage) {
        std::vector<Point> points;
        for (std::size_t level = 0; level < nominal_shares.size(); ++level)
            points.push_back(axes.at(100 * nominal_shares[level], 100 * c.held[level]));
        svg += path(points, std::string("stroke-width=\"1.6\" stroke=\"") + colour_of(c.evidence) + "\"");
        svg += dots(points, colour_of(c.evidence));
    }
    return svg;
}

std::string phantoms(const std::vector<Coverage>& coverage) {
    const Panel axes(2, 0, 100, false);
    std::string svg = axes.frame("One phantom at a time", "phantoms, %, from the worst on",
                                 "targets within their 95 % interval, %", {0, 20, 40, 60, 80, 100});
    for (const Coverage& c : coverage) {
        std::vector<Point> points;
        for (std::size_t k = 0; k < c.phantom_shares.size(); ++k)
            points.push_back(
                axes.at(100 * (double(k) + 0.5) / double(c.phantom_shares.size()), 100 * c.phantom_shares[k]));
        svg += path(points, std::string("stroke-width=\"1.6\" stroke=\"") + colour_of(c.evidence) + "\"");
    }
    return svg;
}

std::string label_of(const Coverage& c) {
    return std::string(words_for(c.evidence)) + " (" + std::to_string(c.phantoms) + " phantoms" +
           (c.shown_share > 0 ? ")" : ", not trusted)");
}

std::string legend(const std::vector<Coverage>& coverage) {
    std::string svg;
    report::FigurePoint at{left, height - 20};
    for (const Coverage& c : coverage) {
        const report::FigureCurve style{colour_of(c.evidence), report::LineStyle::Solid, report::Mark::Dot};
        svg += report::svg_legend_entry(at, style, label_of(c));
        at.x += report::legend_width(label_of(c));
    }
    return svg;
}

}  // namespace

std::string coverage_figure(const std::vector<Coverage>& coverage) {
    return report::svg_figure(width, height,
                              reliability(coverage) + shares(coverage) + phantoms(coverage) + legend(coverage));
}

}  // namespace tissuewarp::study
