#include "study/coverage_summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

namespace tissuewarp::study {

namespace {

constexpr std::size_t bins = 10;
constexpr std::size_t level_95 = 2;

using Rows = std::vector<const CoverageRow*>;

bool holds(const CoverageRow& row, double probability) {
    return row.error.norm() <= registration::interval_mm(row.estimate, probability);
}

double share_held(const Rows& rows, double probability) {
    const auto held =
        std::count_if(rows.begin(), rows.end(), [&](const CoverageRow* row) { return holds(*row, probability); });
    return double(held) / double(rows.size());
}

double true_mm(const Rows& rows) {
    double sum = 0;
    for (const CoverageRow* row : rows) sum += row->error.squaredNorm();
    return std::sqrt(sum / double(rows.size()));
}

double estimated_mm(const Rows& rows) {
    double sum = 0;
    for (const CoverageRow* row : rows) sum += row->estimate.deviation_mm * row->estimate.deviation_mm;
    return std::sqrt(sum / double(rows.size()));
}

double mean_interval_mm(const Rows& rows) {
    double sum = 0;
    for (const CoverageRow* row : rows) sum += registration::interval_mm(row->estimate, nominal_shares[level_95]);
    return sum / double(rows.size());
}

std::vector<ReliabilityBin> binned(Rows rows) {
    std::sort(rows.begin(), rows.end(), [](const CoverageRow* a, const CoverageRow* b) {
        return a->estimate.deviation_mm < b->estimate.deviation_mm;
    });
    std::vector<ReliabilityBin> result;
    for (std::size_t bin = 0; bin < bins; ++bin) {
        const auto at = [&](std::size_t b) { return rows.begin() + std::ptrdiff_t(b * rows.size() / bins); };
        const Rows part(at(bin), at(bin + 1));
        if (!part.empty()) result.push_back({int(part.size()), estimated_mm(part), true_mm(part)});
    }
    return result;
}

double percentile(std::vector<double> values, double share) {
    const auto rank = std::min(values.size() - 1, static_cast<std::size_t>(share * double(values.size())));
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(rank), values.end());
    return values[rank];
}

bool has_failed(const Rows& rows) {
    std::vector<double> errors, ratios;
    for (const CoverageRow* row : rows) {
        errors.push_back(row->error.norm());
        ratios.push_back(row->error.norm() / row->estimate.interval_mm);
    }
    return percentile(errors, 0.95) > coverage_failure.error_mm ||
           percentile(ratios, 0.95) > coverage_failure.error_of_radius;
}

/// Whether those that failed are doubted, and those that did not are not.
void add_doubts(Coverage& result, const std::map<std::uint64_t, Rows>& by_phantom) {
    int failed = 0, doubted_failures = 0, doubted_successes = 0;
    for (const auto& [seed, rows] : by_phantom) {
        const bool has_doubt = !rows.front()->doubts.empty(), fails = has_failed(rows);
        failed += fails;
        (fails ? doubted_failures : doubted_successes) += has_doubt;
    }
    const auto share = [](int part, int all) {
        return all > 0 ? double(part) / all : std::numeric_limits<double>::quiet_NaN();
    };
    result.doubted_share = share(doubted_failures + doubted_successes, result.phantoms);
    result.failed_share = share(failed, result.phantoms);
    result.doubted_failures = share(doubted_failures, failed);
    result.doubted_successes = share(doubted_successes, result.phantoms - failed);
}

void add_classes(Coverage& result, const Rows& rows) {
    Rows shown;
    std::vector<double> errors, radii;
    int unknown = 0;
    for (const CoverageRow* row : rows) {
        errors.push_back(row->error.norm());
        radii.push_back(row->estimate.interval_mm);
        if (row->estimate.trust == registration::Trust::Shown) shown.push_back(row);
        unknown += row->estimate.trust == registration::Trust::Unknown;
    }
    result.shown_share = double(shown.size()) / double(rows.size());
    result.unknown_share = double(unknown) / double(rows.size());
    result.held_95_shown =
        shown.empty() ? std::numeric_limits<double>::quiet_NaN() : share_held(shown, nominal_shares[level_95]);
    result.sharpness = percentile(errors, 0.95) / percentile(radii, 0.5);
}

Coverage summary_of(Evidence evidence, bool in_view, const Rows& rows) {
    Coverage result;
    result.evidence = evidence;
    result.in_view = in_view;
    result.targets = int(rows.size());
    std::map<std::uint64_t, Rows> by_phantom;
    for (const CoverageRow* row : rows) by_phantom[row->seed].push_back(row);
    result.phantoms = int(by_phantom.size());
    for (std::size_t level = 0; level < nominal_shares.size(); ++level)
        result.held[level] = share_held(rows, nominal_shares[level]);
    double variance = 0;
    int within = 0;
    for (const auto& [seed, here] : by_phantom) {
        within += true_mm(here) <= mean_interval_mm(here);
        result.phantom_shares.push_back(share_held(here, nominal_shares[level_95]));
        const double weight = double(here.size()) / double(rows.size());
        variance += std::pow(weight * (result.phantom_shares.back() - result.held[level_95]), 2);
    }
    result.phantoms_within = double(within) / double(by_phantom.size());
    result.held_95_error = std::sqrt(variance);
    std::sort(result.phantom_shares.begin(), result.phantom_shares.end());
    result.estimated_mm = estimated_mm(rows);
    result.true_mm = true_mm(rows);
    result.bins = binned(rows);
    add_classes(result, rows);
    add_doubts(result, by_phantom);
    return result;
}

}  // namespace

std::vector<Coverage> coverage_of(const std::vector<CoverageRow>& rows) {
    std::vector<Coverage> result;
    for (const Evidence evidence : all_evidence)
        for (const bool in_view : {true, false}) {
            Rows here;
            for (const CoverageRow& row : rows)
                if (row.evidence == evidence && row.in_view == in_view) here.push_back(&row);
            if (!here.empty()) result.push_back(summary_of(evidence, in_view, here));
        }
    return result;
}

std::string table_of(const std::vector<Coverage>& coverage) {
    std::string table =
        "evidence               phantoms targets  within 50 %   80 %   95 %        99 %  sharpness  true rms  "
        "estimated, mm  phantoms within, %  shown, %  of these within 95 %  unknown, %  doubted, %  failed, %  of these doubted, %  of the others doubted, %\n";
    for (const Coverage& c : coverage) {
        char line[400];
        std::snprintf(
            line, sizeof line,
            "%-22s %8d %7d %12.1f %6.1f %6.1f ±%4.1f %6.1f %10.2f %9.2f %14.2f %19.0f %9.0f %21.1f %11.0f %11.0f %10.0f %19.0f %23.0f\n",
            (std::string(name_of(c.evidence)) + (c.in_view ? "" : ", unseen")).c_str(), c.phantoms, c.targets,
            100 * c.held[0], 100 * c.held[1], 100 * c.held[2], 100 * c.held_95_error, 100 * c.held[3], c.sharpness,
            c.true_mm, c.estimated_mm, 100 * c.phantoms_within, 100 * c.shown_share, 100 * c.held_95_shown,
            100 * c.unknown_share, 100 * c.doubted_share, 100 * c.failed_share, 100 * c.doubted_failures,
            100 * c.doubted_successes);
        table += line;
    }
    return table;
}

}  // namespace tissuewarp::study
