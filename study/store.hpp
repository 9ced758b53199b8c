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

class Store {
public:
    /// Reads results.h5 of the folder, which exists, when it is there. Throws IoError; InvalidInput where that file is
    /// no such file or was measured with other provenance: times of two machines make no front.
    Store(std::filesystem::path folder, Provenance provenance);

    [[nodiscard]] const std::vector<Point>& points() const { return points_; }
    [[nodiscard]] bool holds(const std::string& problem, const Setting& setting) const;

    /// Writes results.h5 and results.csv anew, each to a temporary name that is renamed. Throws IoError.
    void add(Point point);

    /// The whole of results.csv: a line for each point; lengths in mm, times in s.
    [[nodiscard]] std::string csv() const;

private:
    void write() const;

    std::filesystem::path folder_;
    Provenance provenance_;
    std::vector<Point> points_;
};

/// results.h5. Throw IoError and InvalidInput.
void write_points(const std::vector<Point>& points, const Provenance& provenance, const std::filesystem::path& path);
std::vector<Point> read_points(const std::filesystem::path& path, Provenance* provenance = nullptr);

}  // namespace tissuewarp::study
