#pragma once
/// Measured points in a folder, complete after each of them: an interrupted study goes on where it was.

#include "study/point.hpp"

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tissuewarp::study {

/// Name → value: version, machine, device, …
using Provenance = std::map<std::string, std::string>;

/// What a page says about a problem.
struct ProblemSummary {
    std::string name, story;
    Setting base;
    bool registration = false;
};

/// All that results.h5 holds.
struct Measurements {
    std::vector<ProblemSummary> problems;  ///< each once
    std::vector<Point> points;
    Provenance provenance;
};

class Store {
public:
    /// Reads results.h5 of the folder, which exists, when it is there. Throws IoError; InvalidInput where that file is
    /// no such file or was measured with other provenance: times of two machines make no front.
    Store(std::filesystem::path folder, Provenance provenance);

    [[nodiscard]] const std::vector<Point>& points() const { return measured_.points; }
    /// Those described, in the order of their first description, of earlier runs too.
    [[nodiscard]] const std::vector<ProblemSummary>& problems() const { return measured_.problems; }
    [[nodiscard]] bool holds(const std::string& problem, const Setting& setting) const;

    /// Replaces what was said about a problem of that name; written with the next point.
    void describe(ProblemSummary problem);

    /// Writes results.h5 and results.csv anew, each to a temporary name that is renamed. Throws IoError.
    void add(Point point);

    /// The whole of results.csv: a line for each point; lengths in mm, times in s.
    [[nodiscard]] std::string csv() const;

private:
    void write() const;

    std::filesystem::path folder_;
    Measurements measured_;
};

/// results.h5. Throw IoError and InvalidInput.
void write_measurements(const Measurements& measured, const std::filesystem::path& path);
Measurements read_measurements(const std::filesystem::path& path);

}  // namespace tissuewarp::study
