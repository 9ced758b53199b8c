// results.h5: a row of each dataset for each point, stages and places as long tables that name their point.

#include "study/store.hpp"

#include "core/atomic_file.hpp"
#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"

#include <functional>

namespace tissuewarp::study {

namespace {

constexpr const char* format = "tissuewarp study";
constexpr int version = 2;
constexpr double absent = -1;  // no length or time is negative

double stored(const std::optional<double>& value) {
    return value.value_or(absent);
}
std::optional<double> loaded(double value) {
    return value == absent ? std::nullopt : std::optional(value);
}

/// One dataset for a quantity of every point, both ways.
struct TextColumn {
    const char* name;
    std::function<std::string(const Point&)> get;
    std::function<void(Point&, const std::string&)> set;
};
struct NumberColumn {
    const char *name, *units;
    std::function<double(const Point&)> get;
    std::function<void(Point&, double)> set;
};

const std::vector<TextColumn>& text_columns() {
    static const std::vector<TextColumn> columns{
        {"problem", [](const Point& p) { return p.problem; }, [](Point& p, const std::string& v) { p.problem = v; }},
        {"setting/element", [](const Point& p) { return name_of(p.setting.element); },
         [](Point& p, const std::string& v) { p.setting.element = element_named(v); }},
        {"setting/law", [](const Point& p) { return name_of(p.setting.physics.law); },
         [](Point& p, const std::string& v) { p.setting.physics.law = law_named(v); }},
        {"setting/hold", [](const Point& p) { return name_of(p.setting.physics.hold); },
         [](Point& p, const std::string& v) { p.setting.physics.hold = hold_named(v); }},
        {"setting/solver", [](const Point& p) { return name_of(p.setting.solver); },
         [](Point& p, const std::string& v) { p.setting.solver = solver_named(v); }},
        {"setting/arithmetic", [](const Point& p) { return name_of(p.setting.arithmetic); },
         [](Point& p, const std::string& v) { p.setting.arithmetic = scalar_named(v); }},
        {"setting/processor", [](const Point& p) { return name_of(p.setting.processor); },
         [](Point& p, const std::string& v) { p.setting.processor = processor_named(v); }},
        {"engine", [](const Point& p) { return p.engine; }, [](Point& p, const std::string& v) { p.engine = v; }},
        {"method", [](const Point& p) { return p.method; }, [](Point& p, const std::string& v) { p.method = v; }},
        {"failure", [](const Point& p) { return p.failure; }, [](Point& p, const std::string& v) { p.failure = v; }}};
    return columns;
}

/// A column of a member that is always there.
template <class Member>
NumberColumn always(const char* name, const char* units, const Member& member) {
    return {name, units, [member](const Point& p) { return double(member(p)); },
            [member](Point& p, double v) {
                auto& target = member(p);
                target = static_cast<std::decay_t<decltype(target)>>(v);
            }};
}

/// A column of an optional number.
NumberColumn perhaps(const char* name, std::optional<double> Point::*member) {
    return {name, "mm", [member](const Point& p) { return stored(p.*member); },
            [member](Point& p, double v) { p.*member = loaded(v); }};
}

/// A column of a number within an optional group.
template <class Group>
NumberColumn within(const char* name, std::optional<Group> Point::*group, double Group::*member) {
    return {name, "mm", [=](const Point& p) { return p.*group ? (*(p.*group)).*member : absent; },
            [=](Point& p, double v) {
                if (v == absent) return;
                if (!(p.*group)) (p.*group).emplace();
                (*(p.*group)).*member = v;
            }};
}

const std::vector<NumberColumn>& number_columns() {
    static const std::vector<NumberColumn> columns{
        always(
            "setting/elements", "1", [](auto& p) -> auto& { return p.setting.elements; }),
        always(
            "setting/poissons_ratio", "1", [](auto& p) -> auto& { return p.setting.physics.poissons_ratio; }),
        always(
            "setting/tolerance", "mm", [](auto& p) -> auto& { return p.setting.tolerance_mm; }),
        always(
            "elements", "1", [](auto& p) -> auto& { return p.elements; }),
        always(
            "nodes", "1", [](auto& p) -> auto& { return p.nodes; }),
        always(
            "force_evaluations", "1", [](auto& p) -> auto& { return p.force_evaluations; }),
        always(
            "min_jacobian", "1", [](auto& p) -> auto& { return p.min_jacobian; }),
        always(
            "estimated_error", "mm", [](auto& p) -> auto& { return p.estimated_mm; }),
        perhaps("algebraic_error", &Point::algebraic_mm),
        perhaps("reference_uncertainty", &Point::reference_mm),
        within("numerical_error/rms", &Point::numerical, &Distance::rms),
        within("numerical_error/largest", &Point::numerical, &Distance::largest),
        within("model_error/rms", &Point::model, &Distance::rms),
        within("model_error/largest", &Point::model, &Distance::largest),
        within("target_error/mean", &Point::target, &TargetErrors::mean),
        within("target_error/median", &Point::target, &TargetErrors::median),
        within("target_error/percentile_95", &Point::target, &TargetErrors::percentile_95),
        within("target_error/largest", &Point::target, &TargetErrors::largest),
        within("target_error/before", &Point::target, &TargetErrors::before)};
    return columns;
}

/// Rows of (point, run, seconds) with the names of their stages; "" is the operation end to end.
void write_times(Hdf5Output& file, const std::vector<Point>& points) {
    std::vector<std::string> stage, phase;
    std::vector<double> rows;
    const auto add = [&](std::size_t point, const std::string& name, const char* when, const std::vector<double>& s) {
        for (std::size_t run = 0; run < s.size(); ++run) {
            stage.push_back(name);
            phase.emplace_back(when);
            rows.insert(rows.end(), {double(point), double(run), s[run]});
        }
    };
    for (std::size_t i = 0; i < points.size(); ++i) {
        add(i, "", "operation", points[i].seconds);
        for (const Stage& each : points[i].stages)
            add(i, each.name, each.phase == Phase::Preparation ? "preparation" : "operation", each.seconds);
    }
    file.texts("times/stage", stage);
    file.texts("times/phase", phase);
    file.columns<double>("times/point_run_seconds",
                         Eigen::MatrixXd::Map(rows.data(), 3, static_cast<Eigen::Index>(stage.size())), "1, 1, s");
}

void read_times(const Hdf5Input& file, std::vector<Point>& points, const std::string& path) {
    const std::vector<std::string> stage = file.texts("times/stage"), phase = file.texts("times/phase");
    const Eigen::MatrixXd rows = file.columns<double>("times/point_run_seconds", 3);
    if (stage.size() != phase.size() || static_cast<Eigen::Index>(stage.size()) != rows.cols())
        throw InvalidInput("'" + path + "': the times have " + std::to_string(rows.cols()) + " rows and " +
                           std::to_string(stage.size()) + " names");
    for (std::size_t row = 0; row < stage.size(); ++row) {
        const auto at = rows.col(static_cast<Eigen::Index>(row));
        if (!(at[0] >= 0 && at[0] < double(points.size())))
            throw InvalidInput("'" + path + "': a time belongs to point " + std::to_string(at[0]) + " of " +
                               std::to_string(points.size()));
        Point& point = points[static_cast<std::size_t>(at[0])];
        if (stage[row].empty()) {
            point.seconds.push_back(at[2]);
            continue;
        }
        const Phase when = phase[row] == "preparation" ? Phase::Preparation : Phase::Operation;
        if (point.stages.empty() || point.stages.back().name != stage[row] || point.stages.back().phase != when)
            point.stages.push_back({stage[row], when, {}});
        point.stages.back().seconds.push_back(at[2]);
    }
}

void write_places(Hdf5Output& file, const std::vector<Point>& points) {
    Eigen::Index all = 0;
    for (const Point& point : points) all += point.places.cols();
    Eigen::MatrixXd rows(4, all);
    Eigen::Index at = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
        for (const auto& place : points[i].places.colwise()) rows.col(at++) << double(i), place;
    file.columns<double>("point_place", rows, "1, mm, mm, mm");
}

void read_places(const Hdf5Input& file, std::vector<Point>& points, const std::string& path) {
    const Eigen::MatrixXd rows = file.columns<double>("point_place", 4);
    for (Eigen::Index first = 0, end = 0; first < rows.cols(); first = end) {
        while (end < rows.cols() && rows(0, end) == rows(0, first)) ++end;
        if (!(rows(0, first) >= 0 && rows(0, first) < double(points.size())))
            throw InvalidInput("'" + path + "': places belong to point " + std::to_string(rows(0, first)) + " of " +
                               std::to_string(points.size()));
        points[static_cast<std::size_t>(rows(0, first))].places = rows.block(1, first, 3, end - first);
    }
}

/// Each problem with the row of its base among the points, −1 where that was not measured.
void write_problems(Hdf5Output& file, const Measurements& measured) {
    std::vector<std::string> names, stories, kinds;
    Eigen::VectorXd base = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(measured.problems.size()), absent);
    for (const ProblemSummary& problem : measured.problems) {
        for (std::size_t i = 0; i < measured.points.size(); ++i)
            if (measured.points[i].problem == problem.name && measured.points[i].setting == problem.base)
                base[static_cast<Eigen::Index>(names.size())] = double(i);
        names.push_back(problem.name);
        stories.push_back(problem.story);
        kinds.emplace_back(problem.registration ? "registration" : "body");
    }
    file.texts("problems/name", names);
    file.texts("problems/story", stories);
    file.texts("problems/kind", kinds);
    file.vector<double>("problems/point_of_base", base, "1");
}

/// Without problems whose base was not measured: the study describes them anew when it goes on with them.
void read_problems(const Hdf5Input& file, Measurements& measured, const std::string& path) {
    const std::vector<std::string> names = file.texts("problems/name"), stories = file.texts("problems/story"),
                                   kinds = file.texts("problems/kind");
    if (stories.size() != names.size() || kinds.size() != names.size())
        throw InvalidInput("'" + path + "': " + std::to_string(names.size()) + " problems have " +
                           std::to_string(stories.size()) + " stories and " + std::to_string(kinds.size()) + " kinds");
    const Eigen::VectorXd base = file.vector<double>("problems/point_of_base", static_cast<Eigen::Index>(names.size()));
    for (std::size_t i = 0; i < names.size(); ++i) {
        const double row = base[static_cast<Eigen::Index>(i)];
        if (row == absent) continue;
        if (!(row >= 0 && row < double(measured.points.size())))
            throw InvalidInput("'" + path + "': the base of '" + names[i] + "' is point " + std::to_string(row) +
                               " of " + std::to_string(measured.points.size()));
        measured.problems.push_back(
            {names[i], stories[i], measured.points[static_cast<std::size_t>(row)].setting, kinds[i] == "registration"});
    }
}

void write_provenance(Hdf5Output& file, const Provenance& provenance) {
    std::vector<std::string> names, values;
    for (const auto& [name, value] : provenance) {
        names.push_back(name);
        values.push_back(value);
    }
    file.texts("provenance/name", names);
    file.texts("provenance/value", values);
}

Provenance read_provenance(const Hdf5Input& file) {
    const std::vector<std::string> names = file.texts("provenance/name"), values = file.texts("provenance/value");
    Provenance provenance;
    for (std::size_t row = 0; row < std::min(names.size(), values.size()); ++row) provenance[names[row]] = values[row];
    return provenance;
}

void write_columns(Hdf5Output& file, const std::vector<Point>& points) {
    for (const TextColumn& column : text_columns()) {
        std::vector<std::string> values;
        for (const Point& point : points) values.push_back(column.get(point));
        file.texts(column.name, values);
    }
    for (const NumberColumn& column : number_columns()) {
        Eigen::VectorXd values(static_cast<Eigen::Index>(points.size()));
        for (std::size_t i = 0; i < points.size(); ++i) values[static_cast<Eigen::Index>(i)] = column.get(points[i]);
        file.vector<double>(column.name, values, column.units);
    }
}

std::vector<Point> read_columns(const Hdf5Input& file, const std::string& path) {
    std::vector<Point> points(file.texts("problem").size());
    for (const TextColumn& column : text_columns()) {
        const std::vector<std::string> values = file.texts(column.name);
        if (values.size() != points.size())
            throw InvalidInput("'" + path + "': '" + column.name + "' has " + std::to_string(values.size()) +
                               " entries for " + std::to_string(points.size()) + " points");
        for (std::size_t i = 0; i < points.size(); ++i) column.set(points[i], values[i]);
    }
    for (const NumberColumn& column : number_columns()) {
        const Eigen::VectorXd values = file.vector<double>(column.name, static_cast<Eigen::Index>(points.size()));
        for (std::size_t i = 0; i < points.size(); ++i) column.set(points[i], values[static_cast<Eigen::Index>(i)]);
    }
    return points;
}

}  // namespace

void write_measurements(const Measurements& measured, const std::filesystem::path& path) {
    AtomicFile target(path);
    Hdf5Output file(target.path(), format, version);
    write_columns(file, measured.points);
    write_times(file, measured.points);
    write_places(file, measured.points);
    write_problems(file, measured);
    write_provenance(file, measured.provenance);
    file.close();
    target.commit();
}

Measurements read_measurements(const std::filesystem::path& path) {
    const Hdf5Input file(path, format, version, version);
    Measurements measured;
    measured.points = read_columns(file, path.string());
    read_times(file, measured.points, path.string());
    read_places(file, measured.points, path.string());
    read_problems(file, measured, path.string());
    measured.provenance = read_provenance(file);
    return measured;
}

}  // namespace tissuewarp::study
