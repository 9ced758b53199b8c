#include "core/atomic_file.hpp"
#include "study/coverage.hpp"
#include "study/detail/table.hpp"

#include <algorithm>

namespace tissuewarp::study {

namespace {

constexpr const char* header =
    "seed,evidence,target,held_out_z,doubt_codes,error_x,error_y,error_z,moved,in_view,algebraic,discretisation,data,"
    "deviation,"
    "interval,trust,"
    "xx,yy,zz,xy,yz,zx,"
    "cavity_dice,least_det_j";

CoverageRow parsed(detail::TableLine& line) {
    CoverageRow row;
    row.seed = static_cast<std::uint64_t>(line.number());
    const std::string name = line.next();
    const auto* const evidence =
        std::find_if(all_evidence.begin(), all_evidence.end(), [&](Evidence each) { return name == name_of(each); });
    if (evidence == all_evidence.end()) line.refuse("'" + name + "' is no kind of evidence");
    row.evidence = *evidence;
    row.target = static_cast<int>(line.number());
    row.held_out_z = line.number();
    row.doubts = line.next();
    registration::ErrorEstimate& e = row.estimate;
    for (double* value : {&row.error[0], &row.error[1], &row.error[2], &row.moved_mm}) *value = line.number();
    row.in_view = line.number() != 0;
    for (double* value : {&e.algebraic_mm, &e.discretisation_mm, &e.data_mm, &e.deviation_mm, &e.interval_mm})
        *value = line.number();
    e.trust = static_cast<registration::Trust>(line.number());
    Eigen::Matrix3d& c = e.covariance;
    for (double* value : {&c(0, 0), &c(1, 1), &c(2, 2), &c(0, 1), &c(1, 2), &c(0, 2)}) *value = line.number();
    c.triangularView<Eigen::StrictlyLower>() = c.transpose();
    row.cavity_dice = line.number();
    row.least_det_j = line.number();
    return row;
}

}  // namespace

void write_coverage(const std::filesystem::path& path, const std::vector<CoverageRow>& rows) {
    std::ostringstream out;
    out << header << '\n';
    for (const CoverageRow& row : rows) {
        const registration::ErrorEstimate& e = row.estimate;
        const Eigen::Matrix3d& c = e.covariance;
        out << row.seed << ',' << name_of(row.evidence) << ',' << row.target << ',' << row.held_out_z << ','
            << row.doubts;
        for (const double value : {row.error[0], row.error[1], row.error[2], row.moved_mm}) out << ',' << value;
        out << ',' << row.in_view;
        for (const double value : {e.algebraic_mm, e.discretisation_mm, e.data_mm, e.deviation_mm, e.interval_mm})
            out << ',' << value;
        out << ',' << static_cast<int>(e.trust);
        for (const double value : {c(0, 0), c(1, 1), c(2, 2), c(0, 1), c(1, 2), c(0, 2)}) out << ',' << value;
        out << ',' << row.cavity_dice << ',' << row.least_det_j << '\n';
    }
    write_file(out.str(), path);
}

std::vector<CoverageRow> read_coverage(const std::filesystem::path& path) {
    std::vector<CoverageRow> rows;
    for (detail::TableLine& line : detail::read_table(path, header)) rows.push_back(parsed(line));
    return rows;
}

}  // namespace tissuewarp::study
