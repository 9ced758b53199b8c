#include "study/store.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <algorithm>
#include <cstdio>

namespace tissuewarp::study {

namespace {

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

std::string quoted(const std::string& text) {
    std::string result = "\"";
    for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c == '\n' ? ' ' : c);
    return result + "\"";
}

/// Fields of a line, separated by commas.
class CsvLine {
public:
    CsvLine& text(const std::string& value) { return field(quoted(value)); }
    CsvLine& count(int value) { return field(std::to_string(value)); }
    CsvLine& value(double v) { return field(number(v)); }
    CsvLine& value(const std::optional<double>& v) { return field(v ? number(*v) : ""); }
    CsvLine& distance(const std::optional<Distance>& d) {
        return d ? value(d->rms).value(d->largest) : field("").field("");
    }
    [[nodiscard]] std::string end() const { return line_ + "\n"; }

private:
    CsvLine& field(const std::string& text) {
        line_ += (line_.empty() ? "" : ",") + text;
        return *this;
    }
    std::string line_;
};

std::string stages_text(const Point& point, Phase phase) {
    std::string text;
    for (const Stage& stage : point.stages) {
        if (stage.phase != phase) continue;
        text += (text.empty() ? "" : "; ") + stage.name + " " + number(percentile(stage.seconds, 0.5));
        if (stage.seconds.size() > 1) text += " (95th " + number(percentile(stage.seconds, 0.95)) + ")";
    }
    return text;
}

std::string csv_line(const Point& p) {
    const Setting& s = p.setting;
    CsvLine line;
    line.text(p.problem).count(s.elements).text(name_of(s.element)).text(name_of(s.physics.law));
    line.value(s.physics.poissons_ratio).text(name_of(s.physics.hold)).text(name_of(s.solver)).value(s.tolerance_mm);
    line.text(name_of(s.arithmetic)).text(name_of(s.processor)).count(p.elements).count(p.nodes);
    const auto of = [&](double value) { return p.solved() ? std::optional(value) : std::nullopt; };
    line.count(static_cast<int>(p.seconds.size()));
    line.value(p.solved() ? of(p.median_seconds()) : std::nullopt);
    line.value(p.solved() ? of(p.percentile_95_seconds()) : std::nullopt);
    line.value(of(p.preparation_seconds())).count(p.force_evaluations).value(of(p.min_jacobian));
    line.value(of(p.estimated_mm)).value(p.algebraic_mm).distance(p.numerical).value(p.reference_mm).distance(p.model);
    const auto target = [&](double TargetErrors::*member) {
        line.value(p.target ? std::optional((*p.target).*member) : std::nullopt);
    };
    target(&TargetErrors::mean), target(&TargetErrors::median), target(&TargetErrors::percentile_95);
    target(&TargetErrors::largest), target(&TargetErrors::before);
    line.text(p.engine).text(p.method).text(stages_text(p, Phase::Preparation)).text(stages_text(p, Phase::Operation));
    return line.text(p.failure).end();
}

}  // namespace

Store::Store(std::filesystem::path folder, Provenance provenance) : folder_(std::move(folder)) {
    const std::filesystem::path file = folder_ / "results.h5";
    if (std::filesystem::exists(file)) measured_ = read_measurements(file);
    for (const auto& [name, value] : provenance)
        if (!measured_.points.empty() && measured_.provenance[name] != value)
            throw InvalidInput("'" + file.string() + "' was measured with " + name + " '" + measured_.provenance[name] +
                               "', this is '" + value + "': times of the two do not compare; give another --output");
    measured_.provenance = std::move(provenance);
}

void Store::describe(ProblemSummary problem) {
    const auto known = std::find_if(measured_.problems.begin(), measured_.problems.end(),
                                    [&](const ProblemSummary& each) { return each.name == problem.name; });
    if (known == measured_.problems.end())
        measured_.problems.push_back(std::move(problem));
    else
        *known = std::move(problem);
}

bool Store::holds(const std::string& problem, const Setting& setting) const {
    return std::any_of(points().begin(), points().end(),
                       [&](const Point& point) { return point.problem == problem && point.setting == setting; });
}

void Store::add(Point point) {
    measured_.points.push_back(std::move(point));
    write();
}

void Store::write() const {
    write_measurements(measured_, folder_ / "results.h5");
    write_file(csv(), folder_ / "results.csv");
}

std::string Store::csv() const {
    std::string text =
        "problem,elements_wanted,element,law,poissons_ratio,hold,solver,tolerance_mm,arithmetic,processor,elements,"
        "nodes,runs,median_s,percentile_95_s,preparation_s,force_evaluations,min_jacobian,estimated_mm,algebraic_mm,"
        "numerical_rms_mm,numerical_largest_mm,reference_uncertainty_mm,model_rms_mm,model_largest_mm,tre_mean_mm,"
        "tre_median_mm,tre_95_mm,tre_largest_mm,tre_before_mm,engine,method,preparation_stages_s,operation_stages_s,"
        "failure\n";
    for (const Point& point : points()) text += csv_line(point);
    return text;
}

}  // namespace tissuewarp::study
