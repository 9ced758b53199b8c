#include "study/findings.hpp"

#include "study/fronts.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tissuewarp::study {

namespace {

constexpr const char* factors[] = {"elements", "tolerance", "element",    "law",      "Poisson's ratio",
                                   "hold",     "solver",    "arithmetic", "processor"};
constexpr double same_error = 0.05, same_time = 0.1;  // what counts as equal

std::string printed(const char* format, double value) {
    char text[40];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

std::string value_of(const std::string& factor, const Setting& setting) {
    if (factor == "elements") return std::to_string(setting.elements);
    if (factor == "tolerance") return printed("%g mm", setting.tolerance_mm);
    if (factor == "element") return name_of(setting.element);
    if (factor == "law") return name_of(setting.physics.law);
    if (factor == "Poisson's ratio") return printed("%g", setting.physics.poissons_ratio);
    if (factor == "hold") return name_of(setting.physics.hold);
    if (factor == "solver") return name_of(setting.solver);
    if (factor == "arithmetic") return name_of(setting.arithmetic);
    return name_of(setting.processor) + ", " + std::to_string(setting.elements);
}

/// Errors to the same reference are not, where they differ by less than is known of it.
bool told_apart(const Point& point, const Point& base) {
    if (!(point.setting.physics == base.setting.physics)) return true;
    return std::abs(point.error_mm() - base.error_mm()) > base.reference_mm.value_or(0);
}

std::string verdict_of(double error_ratio, double time_ratio, bool told_apart) {
    const int accuracy = error_ratio < 1 - same_error ? 1 : error_ratio > 1 + same_error ? -1 : 0;
    const int speed = time_ratio < 1 - same_time ? 1 : time_ratio > 1 + same_time ? -1 : 0;
    const char* accurate[] = {"less accurate", "as accurate", "more accurate"};
    const char* fast[] = {"slower", "as fast", "faster"};
    if (accuracy != 0 && !told_apart)
        return std::string("the reference does not tell which is more accurate, ") + fast[speed + 1];
    std::string words = std::string(accurate[accuracy + 1]) + ", " + fast[speed + 1];
    if (accuracy + speed < 0 && accuracy <= 0 && speed <= 0) words += ": does not pay";
    if (accuracy + speed > 0 && accuracy >= 0 && speed >= 0) words += ": pays";
    return words;
}

std::vector<Comparison> comparisons_of(const Setting& base_setting, const Point& base,
                                       const std::vector<const Point*>& points) {
    std::vector<Comparison> comparisons;
    for (const char* factor : factors)
        for (const Point* point : points) {
            if (factor_of(point->setting, base_setting) != factor) continue;
            const double error = point->error_mm() / base.error_mm();
            const double time = point->median_seconds() / base.median_seconds();
            comparisons.push_back({point, factor, value_of(factor, point->setting), error, time,
                                   verdict_of(error, time, told_apart(*point, base))});
        }
    return comparisons;
}

std::string sentence(const char* what, const Point& point) {
    return std::string(what) + ": " + mm_text(point.error_mm()) + " mm in " + seconds_text(point.median_seconds()) +
           " (prepared in " + seconds_text(point.preparation_seconds()) + "): " + words_of(point.setting);
}

}  // namespace

std::string seconds_text(double seconds) {
    if (seconds < 0.1) return printed("%.3g ms", 1000 * seconds);
    return printed(seconds < 10 ? "%.2f s" : "%.0f s", seconds);
}

std::string mm_text(double millimetres) {
    if (millimetres >= 0.1) return printed("%.2f", millimetres);
    return printed("%.2g", millimetres);
}

Findings findings_of(const ProblemSummary& problem, const std::vector<Point>& points) {
    Findings findings;
    std::vector<Cost> costs;
    for (const Point& point : points) {
        if (point.problem != problem.name) continue;
        if (!point.solved()) {
            findings.failures.push_back(words_of(point.setting) + ": " + point.failure);
            continue;
        }
        findings.solved.push_back(&point);
        costs.push_back({point.median_seconds(), point.error_mm()});
        if (point.setting == problem.base) findings.base = &point;
    }
    if (findings.solved.empty()) return findings;
    for (const std::size_t i : pareto_front(costs)) findings.front.push_back(findings.solved[i]);
    findings.best = findings.front.back();
    if (problem.registration) findings.knee = findings.solved[knee(costs)];
    if (findings.base != nullptr) {
        findings.comparisons = comparisons_of(problem.base, *findings.base, findings.solved);
        findings.lines.push_back(sentence("base", *findings.base));
    }
    findings.lines.push_back(sentence("most accurate", *findings.best));
    if (findings.knee != nullptr) findings.lines.push_back(sentence("knee, within 5 % of that", *findings.knee));
    return findings;
}

}  // namespace tissuewarp::study
