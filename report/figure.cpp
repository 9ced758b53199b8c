#include "report/figure.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <initializer_list>
#include <limits>

namespace tissuewarp::report {

namespace {

[[gnu::format(printf, 1, 2)]] std::string printed(const char* format, ...) {
    char text[200];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return text;
}

/// 6 000, 0.01, 1e7 becomes 10 000 000.
std::string number_text(double value) {
    std::string digits = value < 100 ? printed("%g", value) : printed("%.0f", value);
    if (value >= 10000)
        for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3)
            digits.insert(static_cast<std::size_t>(at), "\u202f");
    return digits;
}

/// These digits times powers of ten within `low` and `high`.
std::vector<double> round_numbers(double low, double high, std::initializer_list<double> digits) {
    std::vector<double> result;
    for (double decade = std::pow(10.0, std::floor(std::log10(low))); decade <= high; decade *= 10)
        for (const double digit : digits)
            if (const double number = digit * decade; number >= low && number <= high) result.push_back(number);
    return result;
}

/// Where ticks stand on an axis from `low` to `high`: decades, and more between them where they are few.
std::vector<double> ticks(double low, double high) {
    constexpr std::size_t enough = 3;
    if (high / low >= 200) return round_numbers(low, high, {1.0});
    std::vector<double> result = round_numbers(low, high, {1.0, 2.0, 5.0});
    if (result.size() < enough) result = round_numbers(low, high, {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0});
    return result;
}

std::string mark_at(FigurePoint p, const FigureCurve& curve) {
    const char* colour = curve.colour.c_str();
    switch (curve.mark) {
        case Mark::Dot:
            return printed("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\"/>\n", p.x, p.y, colour);
        case Mark::Ring:
            return printed("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"8\" fill=\"none\" stroke=\"%s\" stroke-width=\"2\"/>\n",
                           p.x, p.y, colour);
        case Mark::Cross:
            return svg_line({p.x - 4, p.y - 4}, {p.x + 4, p.y + 4}, colour, " stroke-width=\"2\"") +
                   svg_line({p.x - 4, p.y + 4}, {p.x + 4, p.y - 4}, colour, " stroke-width=\"2\"");
        case Mark::None:
            break;
    }
    return {};
}

/// `points` on the page.
std::string drawn_on_page(const FigureCurve& curve, const std::vector<FigurePoint>& points) {
    std::string path, marks;
    for (const FigurePoint& p : points) {
        path += printed("%.1f,%.1f ", p.x, p.y);
        marks += mark_at(p, curve);
    }
    if (curve.line == LineStyle::None) return marks;
    return "<polyline points=\"" + path + "\" fill=\"none\" stroke=\"" + curve.colour + "\"" +
           printed(" stroke-width=\"%.1f\"", curve.thickness) +
           (curve.line == LineStyle::Dashed ? " stroke-dasharray=\"6 4\"" : "") + "/>\n" + marks;
}

}  // namespace

LogPanel::LogPanel(const PanelPlace& place, const std::vector<FigureCurve>& curves)
    : place_(place), low_{std::numeric_limits<double>::max(), std::numeric_limits<double>::max()}, high_{0, 0} {
    for (const FigureCurve& curve : curves)
        for (const FigurePoint& p : curve.points) {
            low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y)};
            high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y)};
        }
    low_ = {low_.x / 1.3, low_.y / 1.5};
    high_ = {high_.x * 1.3, high_.y * 1.5};
}

FigurePoint LogPanel::at(FigurePoint p) const {
    return {place_.left + place_.width * std::log(p.x / low_.x) / std::log(high_.x / low_.x),
            place_.top + place_.height * std::log(high_.y / p.y) / std::log(high_.y / low_.y)};
}

std::string LogPanel::axes() const {
    const double bottom = place_.top + place_.height, right = place_.left + place_.width;
    std::string svg;
    for (const double tick : ticks(low_.x, high_.x)) {
        const double x = at({tick, low_.y}).x;
        svg += svg_line({x, place_.top}, {x, bottom}, "#e5e7eb") + svg_text({x, bottom + 17}, number_text(tick));
    }
    for (const double tick : ticks(low_.y, high_.y)) {
        const double y = at({low_.x, tick}).y;
        svg += svg_line({place_.left, y}, {right, y}, "#e5e7eb") +
               svg_text({place_.left - 6, y + 4}, number_text(tick), "end");
    }
    return svg + printed(
                     "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
                     "stroke=\"#9ca3af\"/>\n",
                     place_.left, place_.top, place_.width, place_.height);
}

std::string LogPanel::drawn(const std::string& title, const std::string& x_label, const std::string& y_label,
                            const std::vector<FigureCurve>& curves, const std::vector<FigureNote>& notes) const {
    const double middle = place_.left + place_.width / 2, bottom = place_.top + place_.height;
    std::string svg = svg_text({middle, place_.top - 10}, title, "middle", " font-weight=\"bold\"") + axes();
    svg += svg_text({middle, bottom + 38}, x_label);
    const double x = place_.left - 58, y = place_.top + place_.height / 2;
    svg += svg_text({x, y}, y_label, "middle", printed(" transform=\"rotate(-90 %.1f %.1f)\"", x, y));
    for (const FigureCurve& curve : curves) {
        std::vector<FigurePoint> points;
        for (const FigurePoint& p : curve.points) points.push_back(at(p));
        svg += drawn_on_page(curve, points);
    }
    for (const FigureNote& note : notes) {
        const FigurePoint p = at(note.at);
        svg += svg_text({p.x + 3, p.y - 5}, note.text, "start");
    }
    return svg;
}

std::string svg_figure(double width, double height, const std::string& content) {
    return printed(
               "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %g %g\" width=\"%g\" height=\"%g\">\n"
               "<rect width=\"100%%\" height=\"100%%\" fill=\"#ffffff\"/>\n",
               width, height, width, height) +
           content + "</svg>\n";
}

std::string svg_text(FigurePoint at, const std::string& content, const char* anchor, const std::string& more) {
    return printed(
               "<text x=\"%.1f\" y=\"%.1f\" font-size=\"12\" text-anchor=\"%s\" font-family=\"sans-serif\" "
               "fill=\"#111827\"",
               at.x, at.y, anchor) +
           more + ">" + content + "</text>\n";
}

std::string svg_line(FigurePoint from, FigurePoint to, const std::string& colour, const std::string& more) {
    return printed("<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\"", from.x, from.y, to.x, to.y,
                   colour.c_str()) +
           more + "/>\n";
}

std::string svg_legend_entry(FigurePoint at, const FigureCurve& curve, const std::string& label) {
    const char* style =
        curve.line == LineStyle::Dashed ? " stroke-width=\"2\" stroke-dasharray=\"6 4\"" : " stroke-width=\"2\"";
    const std::string line = curve.line == LineStyle::None ? "" : svg_line(at, {at.x + 22, at.y}, curve.colour, style);
    return line + mark_at({at.x + 11, at.y}, curve) + svg_text({at.x + 28, at.y + 4}, label, "start");
}

double legend_width(const std::string& label) {
    return 50 + 6.2 * double(label.size());
}

}  // namespace tissuewarp::report
