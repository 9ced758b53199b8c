#pragma once
/// Figures as SVG text: panels with logarithmic axes.

#include <string>
#include <vector>

namespace tissuewarp::report {

/// In the units of the axes; on a page, in pixels from the top left.
struct FigurePoint {
    double x = 0, y = 0;
};

enum class LineStyle { Solid, Dashed, None };
enum class Mark { None, Dot, Ring, Cross };

struct FigureCurve {
    std::string colour;  ///< "#1d4ed8"
    LineStyle line = LineStyle::Solid;
    Mark mark = Mark::Dot;
    std::vector<FigurePoint> points{};
    double thickness = 1.8;  ///< pixels
};

/// Words above a point of a panel.
struct FigureNote {
    FigurePoint at;
    std::string text;
};

/// Where the panel lies within the figure, pixels.
struct PanelPlace {
    double left = 90, top = 70, width = 380, height = 300;
};

/// Axes that hold all curves, with a margin. Coordinates of curves are positive.
class LogPanel {
public:
    LogPanel(const PanelPlace& place, const std::vector<FigureCurve>& curves);

    /// Axes with their words, which may hold entities of SVG, the curves and the notes.
    [[nodiscard]] std::string drawn(const std::string& title, const std::string& x_label, const std::string& y_label,
                                    const std::vector<FigureCurve>& curves,
                                    const std::vector<FigureNote>& notes = {}) const;
    /// On the page.
    [[nodiscard]] FigurePoint at(FigurePoint p) const;

private:
    [[nodiscard]] std::string axes() const;

    PanelPlace place_;
    FigurePoint low_, high_;
};

/// <svg …> with a white ground, what is within, </svg>.
std::string svg_figure(double width, double height, const std::string& content);
/// `anchor` is SVG's "start", "middle" or "end"; `more` further attributes.
std::string svg_text(FigurePoint at, const std::string& content, const char* anchor = "middle",
                     const std::string& more = "");
std::string svg_line(FigurePoint from, FigurePoint to, const std::string& colour, const std::string& more = "");
/// A line or mark as in the panels, and words beside it.
std::string svg_legend_entry(FigurePoint at, const FigureCurve& curve, const std::string& label);
/// Pixels that such an entry takes.
double legend_width(const std::string& label);

}  // namespace tissuewarp::report
