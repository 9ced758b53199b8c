#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "study/coverage.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>

namespace tissuewarp::study {

namespace {

constexpr const char* header =
    "seed,evidence,target,doubts,error_x,error_y,error_z,moved,algebraic,discretisation,data,deviation,interval,shown,"
    "xx,yy,"
    "zz,"
    "xy,xz,yz";

[[noreturn]] void refuse(const std::filesystem::path& path, int line, const std::string& why) {
    throw InvalidInput(path.string() + ", line " + std::to_string(line) + ": " + why +
                       "; remove the file to have it measured again");
}

Evidence evidence_of(const std::string& name, const std::filesystem::path& path, int line) {
    for (const Evidence evidence : all_evidence)
        if (name == name_of(evidence)) return evidence;
    refuse(path, line, "'" + name + "' is no kind of evidence");
}

CoverageRow parsed(const std::string& text, const std::filesystem::path& path, int line) {
    std::stringstream cells(text);
    std::string seed, evidence, rest;
    std::getline(cells, seed, ',');
    std::getline(cells, evidence, ',');
    std::getline(cells, rest);
    std::replace(rest.begin(), rest.end(), ',', ' ');
    CoverageRow row;
    row.evidence = evidence_of(evidence, path, line);
    std::istringstream seed_text(seed), numbers(rest);
    seed_text >> row.seed;
    Eigen::Matrix3d& c = row.estimate.covariance;
    numbers >> row.target >> row.doubts >> row.error[0] >> row.error[1] >> row.error[2] >> row.moved_mm >>
        row.estimate.algebraic_mm >> row.estimate.discretisation_mm >> row.estimate.data_mm >>
        row.estimate.deviation_mm >> row.estimate.interval_mm >> row.estimate.shown >> c(0, 0) >> c(1, 1) >> c(2, 2) >>
        c(0, 1) >> c(0, 2) >> c(1, 2);
    if (!seed_text || !numbers) refuse(path, line, "a number is missing");
    c.triangularView<Eigen::StrictlyLower>() = c.transpose();
    return row;
}

}  // namespace

void write_coverage(const std::filesystem::path& path, const std::vector<CoverageRow>& rows) {
    AtomicFile file(path);
    std::ofstream out(file.path());
    out.precision(6);
    out << header << '\n';
    for (const CoverageRow& row : rows) {
        const registration::ErrorEstimate& e = row.estimate;
        const Eigen::Matrix3d& c = e.covariance;
        out << row.seed << ',' << name_of(row.evidence) << ',' << row.target << ',' << row.doubts;
        for (const double value : {row.error[0], row.error[1], row.error[2], row.moved_mm, e.algebraic_mm,
                                   e.discretisation_mm, e.data_mm, e.deviation_mm, e.interval_mm})
            out << ',' << value;
        out << ',' << e.shown;
        for (const double value : {c(0, 0), c(1, 1), c(2, 2), c(0, 1), c(0, 2), c(1, 2)}) out << ',' << value;
        out << '\n';
    }
    out.close();
    if (!out) throw IoError(path.string() + " cannot be written: is the disk full?");
    file.commit();
}

std::vector<CoverageRow> read_coverage(const std::filesystem::path& path) {
    std::ifstream in(path);
    if (!in) throw IoError(path.string() + " cannot be read");
    std::string text;
    std::getline(in, text);
    if (text != header) refuse(path, 1, "this is no table of coverage, or one of another version");
    std::vector<CoverageRow> rows;
    for (int line = 2; std::getline(in, text); ++line) rows.push_back(parsed(text, path, line));
    return rows;
}

}  // namespace tissuewarp::study
