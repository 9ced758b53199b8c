#include "study/detail/figures.hpp"

#include "report/figure.hpp"
#include "study/fronts.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

namespace tissuewarp::study::detail {

namespace {

using report::FigureCurve;
using report::FigureNote;
using report::FigurePanel;
using report::FigurePoint;
using report::LegendEntry;
using report::LineStyle;
using report::Mark;

/// How points that differ from the base in one factor are drawn.
struct Look {
    const char *factor, *label, *colour;
    LineStyle line;
};
constexpr Look looks[] = {{"elements", "elements", "#1d4ed8", LineStyle::Solid},
                          {"tolerance", "tolerance", "#c2410c", LineStyle::Solid},
                          {"elements and tolerance", "both", "#9ca3af", LineStyle::None},
                          {"element", "element", "#047857", LineStyle::None},
                          {"law", "law", "#a21caf", LineStyle::None},
                          {"Poisson's ratio", "Poisson's ratio", "#0891b2", LineStyle::None},
                          {"hold", "hard or soft", "#ca8a04", LineStyle::None},
                          {"solver", "solver", "#be123c", LineStyle::None},
                          {"arithmetic", "float64", "#4d7c0f", LineStyle::None},
                          {"processor", "other processor", "#7c3aed", LineStyle::Solid}};

/// On logarithmic axes nothing is zero.
FigurePoint place_of(const Point& point) {
    return {std::max(point.median_seconds(), 1e-6), std::max(point.error_mm(), 1e-6)};
}

/// With the base, which every factor passes through, by rising elements or falling tolerance.
FigureCurve curve_of(const Look& look, const ProblemSummary& problem, const Findings& findings) {
    std::vector<const Point*> points;
    for (const Point* point : findings.solved)
        if (factor_of(point->setting, problem.base) == look.factor) points.push_back(point);
    const bool through_base = look.line == LineStyle::Solid && findings.base != nullptr && !points.empty();
    if (through_base && std::string(look.factor) != "processor") points.push_back(findings.base);
    std::sort(points.begin(), points.end(), [](const Point* a, const Point* b) {
        return std::pair(a->setting.elements, -a->setting.tolerance_mm) <
               std::pair(b->setting.elements, -b->setting.tolerance_mm);
    });
    FigureCurve curve{look.colour, look.line};
    for (const Point* point : points) curve.points.push_back(place_of(*point));
    return curve;
}

/// 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times powers of ten within the values, at most `most` of them.
std::vector<double> round_levels(double low, double high, std::size_t most) {
    std::vector<double> levels;
    for (double decade = std::pow(10.0, std::floor(std::log10(low))); decade <= high; decade *= 10)
        for (const double digit : {1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0})
            if (digit * decade > low && digit * decade < high) levels.push_back(digit * decade);
    while (levels.size() > most) {
        std::vector<double> every_other;
        for (std::size_t i = 0; i < levels.size(); i += 2) every_other.push_back(levels[i]);
        levels = every_other;
    }
    return levels;
}

std::string short_number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return text;
}

FigureCurve across(double level, const std::vector<FigureCurve>& curves) {
    double low = std::numeric_limits<double>::max(), high = 0;
    for (const FigureCurve& curve : curves)
        for (const FigurePoint& p : curve.points) {
            low = std::min(low, p.x);
            high = std::max(high, p.x);
        }
    return {"#6b7280", LineStyle::Dashed, Mark::None, {{low, level}, {high, level}}, 1.0};
}

std::string error_name(const ProblemSummary& problem) {
    return problem.registration ? "mean target registration error, mm" : "error inside, root mean square, mm";
}

/// Error and time of settings that differ in nothing but mesh and tolerance.
struct Grid {
    std::vector<double> elements, tolerances;  // ascending
    Eigen::MatrixXd error, seconds;            // tolerances × elements, NaN where nothing was solved
};

Grid grid_of(const ProblemSummary& problem, const Findings& findings) {
    std::map<int, std::map<double, const Point*>> by_mesh;
    for (const Point* point : findings.solved) {
        const std::string factor = factor_of(point->setting, problem.base);
        if (factor == "base" || factor == "elements" || factor == "tolerance" || factor == "elements and tolerance")
            by_mesh[point->setting.elements][point->setting.tolerance_mm] = point;
    }
    Grid grid;
    std::map<double, std::size_t> meshes_with;
    for (const auto& [wanted, points] : by_mesh)
        for (const auto& [tolerance, point] : points) ++meshes_with[tolerance];
    for (const auto& [tolerance, count] : meshes_with)
        if (2 * count > by_mesh.size()) grid.tolerances.push_back(tolerance);
    const auto rows = static_cast<Eigen::Index>(grid.tolerances.size());
    const auto columns = static_cast<Eigen::Index>(by_mesh.size());
    grid.error = grid.seconds = Eigen::MatrixXd::Constant(rows, columns, std::numeric_limits<double>::quiet_NaN());
    Eigen::Index column = 0;
    for (const auto& [wanted, points] : by_mesh) {
        grid.elements.push_back(points.begin()->second->elements);
        for (Eigen::Index row = 0; row < rows; ++row)
            if (const auto at = points.find(grid.tolerances[static_cast<std::size_t>(row)]); at != points.end()) {
                grid.error(row, column) = at->second->error_mm();
                grid.seconds(row, column) = at->second->median_seconds();
            }
        ++column;
    }
    return grid;
}

/// Lines of equal value, and where each is named.
void add_levels(const Grid& grid, const Eigen::MatrixXd& values, const FigureCurve& look, const char* unit,
                std::vector<FigureCurve>& curves, std::vector<FigureNote>& notes) {
    double low = std::numeric_limits<double>::max(), high = 0;
    for (const double value : values.reshaped()) {
        if (!std::isfinite(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
    }
    for (const double level : round_levels(low, high, 5)) {
        const auto segments = level_line(grid.elements, grid.tolerances, values, level);
        for (const LevelSegment& segment : segments) {
            FigureCurve piece = look;
            for (const Eigen::Vector2d& end : segment) piece.points.push_back({end.x(), end.y()});
            curves.push_back(piece);
        }
        if (segments.empty()) continue;
        const Eigen::Vector2d at = segments[segments.size() / 2][0];
        notes.push_back({{at.x(), at.y()}, short_number(level) + unit});
    }
}

}  // namespace

std::string front_figure(const ProblemSummary& problem, const Findings& findings) {
    std::vector<FigureCurve> curves;
    std::vector<LegendEntry> legend;
    for (const Look& look : looks) {
        FigureCurve curve = curve_of(look, problem, findings);
        if (curve.points.empty()) continue;
        legend.push_back({curve, look.label});
        curves.push_back(std::move(curve));
    }
    FigureCurve front{"#111827", LineStyle::Solid, Mark::None, {}, 3.0};
    for (const Point* point : findings.front) front.points.push_back(place_of(*point));
    legend.push_back({front, "front"});
    curves.push_back(front);
    if (findings.base != nullptr) {
        curves.push_back({"#111827", LineStyle::None, Mark::Ring, {place_of(*findings.base)}});
        legend.push_back({curves.back(), "base"});
    }
    if (findings.knee != nullptr) {
        curves.push_back({"#dc2626", LineStyle::None, Mark::Ring, {place_of(*findings.knee)}});
        legend.push_back({curves.back(), "knee: 5 % from the best"});
    }

    std::vector<FigureNote> notes;
    const FigurePoint last = front.points.back(), first = front.points.front();
    if (problem.registration) {
        for (const double level : round_levels(last.y, std::max(first.y, 1.02 * last.y), 4)) {
            curves.push_back(across(level, curves));
            notes.push_back({curves.back().points.front(), short_number(level) + " mm"});
        }
    } else if (findings.best->reference_mm && *findings.best->reference_mm > 0) {
        curves.push_back(across(*findings.best->reference_mm, curves));
        notes.push_back({curves.back().points.front(), "the reference is known to this"});
    }
    return report::svg_figure(legend,
                              {{.top = 84,
                                .width = 850,
                                .height = 400,
                                .title = "Accuracy over time: " + problem.name,
                                .x = {"s, median of the runs, from data in to displacement out; prepared before"},
                                .y = {error_name(problem)},
                                .curves = curves,
                                .notes = notes}});
}

std::string grid_figure(const ProblemSummary& problem, const Findings& findings) {
    const Grid grid = grid_of(problem, findings);
    if (grid.elements.size() < 2 || grid.tolerances.size() < 2) return {};
    const FigureCurve error{"#1d4ed8", LineStyle::Solid, Mark::None, {}, 2.0};
    const FigureCurve time{"#c2410c", LineStyle::Dashed, Mark::None, {}, 1.5};
    FigureCurve measured{"#6b7280", LineStyle::None, Mark::Dot};
    std::vector<FigureNote> notes;
    for (std::size_t row = 0; row < grid.tolerances.size(); ++row)
        for (std::size_t column = 0; column < grid.elements.size(); ++column)
            if (std::isfinite(grid.error(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column))))
                measured.points.push_back({grid.elements[column], grid.tolerances[row]});
    std::vector<FigureCurve> curves{measured};
    add_levels(grid, grid.error, error, " mm", curves, notes);
    add_levels(grid, grid.seconds, time, " s", curves, notes);
    return report::svg_figure({{error, problem.registration ? "equal target error" : "equal error"},
                               {time, "equal time"},
                               {measured, "measured"}},
                              {{.top = 64,
                                .width = 850,
                                .title = "Meshes against tolerances: " + problem.name,
                                .x = {"elements"},
                                .y = {"tolerance of the solver, mm"},
                                .curves = curves,
                                .notes = notes}});
}

}  // namespace tissuewarp::study::detail
