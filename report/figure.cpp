#include "report/figure.hpp"

#include "report/detail/drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace tissuewarp::report {

namespace {

/// 6 000, 0.01, 1e7 becomes 10 000 000.
std::string number_text(double value) {
    std::string digits = value < 100 ? fmt::format("{:g}", value) : fmt::format("{:.0f}", value);
    if (value >= 10000)
        for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3)
            digits.insert(static_cast<std::size_t>(at), "\u202f");
    return digits;
}

std::string text_at(FigurePoint at, const std::string& content, const char* anchor = "middle",
                    const std::string& more = "") {
    return fmt::format(
        "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"12\" text-anchor=\"{}\" font-family=\"sans-serif\" "
        "fill=\"#111827\"{}>{}</text>\n",
        at.x, at.y, anchor, more, content);
}

/// `line` and marks at points of the page.
std::string drawn(const FigureCurve& look, const std::vector<FigurePoint>& line,
                  const std::vector<FigurePoint>& marks) {
    std::string points, svg;
    for (const FigurePoint& p : line) points += fmt::format("{:.1f},{:.1f} ", p.x, p.y);
    if (look.line != LineStyle::None)
        svg =
            fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}/>\n", points,
                        look.colour, look.thickness, look.line == LineStyle::Dashed ? " stroke-dasharray=\"6 4\"" : "");
    for (const FigurePoint& p : marks)
        if (look.mark != Mark::None)
            svg +=
                fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" {}=\"{}\"/>\n", p.x, p.y,
                            look.mark == Mark::Dot ? "r=\"3\" fill" : "r=\"8\" fill=\"none\" stroke-width=\"2\" stroke",
                            look.colour);
    return svg;
}

/// Where values of an axis lie between its ends, 0 to 1.
class AxisScale {
public:
    /// An axis without ends reaches from the least value over `margin` to the largest times it.
    AxisScale(const FigurePanel& panel, const FigureAxis& axis, double FigurePoint::*coordinate, double margin)
        : logarithmic_(axis.scale == Scale::Logarithmic) {
        for (const FigureCurve& curve : panel.curves)
            for (const FigurePoint& p : curve.points) {
                low_ = std::min(low_, p.*coordinate / margin);
                high_ = std::max(high_, p.*coordinate * margin);
            }
        if (axis.ends) std::tie(low_, high_) = *axis.ends;
    }
    [[nodiscard]] double operator()(double value) const {
        const double bounded = std::clamp(value, low_, high_);
        return logarithmic_ ? std::log(bounded / low_) / std::log(high_ / low_) : (bounded - low_) / (high_ - low_);
    }
    /// Decades, and more between them where they are few; round numbers on a linear axis.
    [[nodiscard]] std::vector<double> ticks() const {
        constexpr std::size_t enough = 3;
        if (!logarithmic_) return within(detail::round_ticks(high_, 5));
        if (high_ / low_ >= 200) return decades({1.0});
        const std::vector<double> few = decades({1.0, 2.0, 5.0});
        return few.size() < enough ? decades({1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0}) : few;
    }

private:
    bool logarithmic_;
    double low_ = std::numeric_limits<double>::max(), high_ = 0;

    [[nodiscard]] std::vector<double> within(std::vector<double> numbers) const {
        std::erase_if(numbers, [this](double number) { return number < low_ || number > high_; });
        return numbers;
    }
    /// These digits times powers of ten.
    [[nodiscard]] std::vector<double> decades(const std::vector<double>& digits) const {
        std::vector<double> numbers;
        for (double decade = std::pow(10.0, std::floor(std::log10(low_))); decade <= high_; decade *= 10)
            for (const double digit : digits) numbers.push_back(digit * decade);
        return within(std::move(numbers));
    }
};

std::string drawn(const FigurePanel& panel) {
    const AxisScale across(panel, panel.x, &FigurePoint::x, 1.3), up(panel, panel.y, &FigurePoint::y, 1.5);
    const double left = panel.left, top = panel.top, width = panel.width, height = panel.height, bottom = top + height;
    const auto at = [&](FigurePoint p) {
        return FigurePoint{left + width * across(p.x), top + height * (1 - up(p.y))};
    };
    std::string grid, svg;
    for (const double tick : across.ticks()) {
        const double x = left + width * across(tick);
        grid += fmt::format("M{:.1f} {:.1f}v{:g}", x, top, height);
        svg += text_at({x, bottom + 17}, number_text(tick));
    }
    for (const double tick : up.ticks()) {
        const double y = top + height * (1 - up(tick));
        grid += fmt::format("M{:g} {:.1f}h{:g}", left, y, width);
        svg += text_at({left - 6, y + 4}, number_text(tick), "end");
    }
    svg = fmt::format(
              "<path d=\"{}\" stroke=\"#e5e7eb\"/>\n"
              "<rect x=\"{:g}\" y=\"{:g}\" width=\"{:g}\" height=\"{:g}\" fill=\"none\" stroke=\"#9ca3af\"/>\n",
              grid, left, top, width, height) +
          svg;
    svg += text_at({left + width / 2, top - 10}, panel.title, "middle", " font-weight=\"bold\"") +
           text_at({left + width / 2, bottom + 38}, panel.x.label) +
           text_at({left - 58, top + height / 2}, panel.y.label, "middle",
                   fmt::format(" transform=\"rotate(-90 {:g} {:g})\"", left - 58, top + height / 2));
    for (const FigureCurve& curve : panel.curves) {
        std::vector<FigurePoint> points;
        for (const FigurePoint& p : curve.points) points.push_back(at(p));
        svg += drawn(curve, points, points);
    }
    for (const FigureNote& note : panel.notes)
        svg += text_at({at(note.at).x + 3, at(note.at).y - 5}, note.text, "start");
    return svg;
}

/// Entries side by side, in rows as they fit.
std::string drawn(const std::vector<LegendEntry>& legend, double width) {
    std::string svg;
    FigurePoint at{40, 22};
    for (const LegendEntry& entry : legend) {
        const double taken = 50 + 6.2 * double(entry.label.size());
        if (at.x + taken > width) at = {40, at.y + 20};
        svg += drawn(entry.look, {at, {at.x + 22, at.y}}, {{at.x + 11, at.y}}) +
               text_at({at.x + 28, at.y + 4}, entry.label, "start");
        at.x += taken;
    }
    return svg;
}

}  // namespace

std::string svg_figure(const std::vector<LegendEntry>& legend, const std::vector<FigurePanel>& panels) {
    double width = 0, height = 0;
    std::string content;
    for (const FigurePanel& panel : panels) {
        width = std::max(width, panel.left + panel.width + 40);
        height = std::max(height, panel.top + panel.height + 60);
        content += drawn(panel);
    }
    return fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" height=\"{1:g}\">\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<g class=\"legend\">\n{2}</g>\n{3}</svg>\n",
        width, height, drawn(legend, width), content);
}

}  // namespace tissuewarp::report
