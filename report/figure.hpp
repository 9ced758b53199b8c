#pragma once
/// Figures as SVG text: panels of curves side by side, with a legend above them.

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::report {

struct FigurePoint {
    double x = 0, y = 0;
};

enum class LineStyle { Solid, Dashed, None };
enum class Mark { None, Dot, Ring };

struct FigureCurve {
    std::string colour;  ///< "#1d4ed8"
    LineStyle line = LineStyle::Solid;
    Mark mark = Mark::Dot;
    std::vector<FigurePoint> points{};  ///< in the units of the axes
    double thickness = 1.8;             ///< pixels
};

/// Words above a point of a panel.
struct FigureNote {
    FigurePoint at;
    std::string text;
};

enum class Scale { Logarithmic, Linear };

struct FigureAxis {
    std::string label;
    Scale scale = Scale::Logarithmic;  ///< of positive values
    std::optional<std::pair<double, double>>
        ends{};  ///< what lies beyond is drawn at them; none: all curves, and a margin
};

/// Lengths in pixels of the figure. Words may hold entities of SVG.
struct FigurePanel {
    double left = 90, top = 70, width = 380, height = 300;
    std::string title;
    FigureAxis x, y;
    std::vector<FigureCurve> curves;
    std::vector<FigureNote> notes{};
};

/// Line and mark as in the panels, and words beside them.
struct LegendEntry {
    FigureCurve look;
    std::string label;
};

/// <svg …>: the panels on white ground. The legend's rows lie 22 pixels from the top and 20 apart.
std::string svg_figure(const std::vector<LegendEntry>& legend, const std::vector<FigurePanel>& panels);

}  // namespace tissuewarp::report
