/// Coverage: what rows say, kept tables, and one phantom from end to end.
#include "study/coverage.hpp"

#include "core/errors.hpp"
#include "study/coverage_summary.hpp"
#include "study/detail/random.hpp"
#include "tests/support/folders.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

namespace tissuewarp::study {
namespace {

namespace fs = std::filesystem;

/// Errors drawn from the very distribution that the estimate states, times a factor: a covariance whose scale is known
/// from six numbers, so that errors over it are of Student's kind.
std::vector<CoverageRow> drawn_rows(double factor) {
    detail::Random random(1);
    std::vector<CoverageRow> rows;
    constexpr double freedom = 6;
    for (std::uint64_t seed = 1; seed <= 4000; ++seed) {
        double chi_square = 0;
        for (int k = 0; k < freedom; ++k) chi_square += std::pow(random.normal(), 2);
        const double scale = std::sqrt((freedom - 2) / chi_square);
        CoverageRow row;
        row.seed = seed;
        row.estimate.trust = registration::Trust::Shown;
        row.estimate.covariance = Eigen::Vector3d(1, 0.5, 0.2).asDiagonal();
        row.estimate.deviation_mm = std::sqrt(row.estimate.covariance.trace());
        row.estimate.interval_mm = registration::interval_mm(row.estimate, 0.95);
        row.error = factor * scale * row.estimate.covariance.diagonal().cwiseSqrt().cwiseProduct(random.normal3());
        rows.push_back(row);
    }
    return rows;
}

TEST(Coverage, IntervalsHoldErrorsOfTheStatedDistribution) {
    const auto coverage = coverage_of(drawn_rows(1));
    ASSERT_EQ(coverage.size(), 1u);
    EXPECT_EQ(coverage[0].targets, 4000);
    EXPECT_NEAR(coverage[0].held[0], 0.50, 0.03);
    EXPECT_NEAR(coverage[0].held[1], 0.80, 0.025);
    EXPECT_NEAR(coverage[0].held[2], 0.95, 0.015);
    EXPECT_NEAR(coverage[0].held[3], 0.99, 0.01);
    EXPECT_NEAR(coverage[0].true_mm / coverage[0].estimated_mm, 1, 0.1);
    EXPECT_DOUBLE_EQ(coverage[0].phantoms_within, coverage[0].held[2]);  // a target each
}

TEST(Coverage, APhantomIsWithinByTheErrorOverAllItsTargets) {
    auto rows = drawn_rows(1);
    rows.resize(2);
    rows[1].seed = rows[0].seed;
    const double radius = registration::interval_mm(rows[0].estimate, 0.95);
    rows[0].error = Eigen::Vector3d(0.5 * radius, 0, 0);
    rows[1].error = Eigen::Vector3d(0, 1.2 * radius, 0);  // together 0.92
    EXPECT_DOUBLE_EQ(coverage_of(rows)[0].phantoms_within, 1);
    EXPECT_DOUBLE_EQ(coverage_of(rows)[0].held[2], 0.5);
    rows[1].error *= 1.2;
    EXPECT_DOUBLE_EQ(coverage_of(rows)[0].phantoms_within, 0);
}

TEST(Coverage, ErrorsHalfAsLargeAgainAreSeen) {
    const auto coverage = coverage_of(drawn_rows(1.5));
    EXPECT_LT(coverage[0].held[2], 0.90);
    EXPECT_GT(coverage[0].true_mm / coverage[0].estimated_mm, 1.3);
}

TEST(Coverage, TellsClassesAndViewsApart) {
    auto rows = drawn_rows(1);
    for (std::size_t k = 0; k < rows.size(); k += 4) {
        rows[k].estimate.trust = registration::Trust::Unknown;
        rows[k].error *= 100;
        rows[k].doubts = "data.contradict placement.loose";
    }
    for (std::size_t k = 1; k < rows.size(); k += 4) rows[k].in_view = false;
    const auto coverage = coverage_of(rows);
    ASSERT_EQ(coverage.size(), 2u);
    EXPECT_TRUE(coverage[0].in_view && !coverage[1].in_view);
    EXPECT_EQ(coverage[0].targets, 3000);
    EXPECT_NEAR(coverage[0].shown_share, 2.0 / 3, 1e-12);
    EXPECT_NEAR(coverage[0].unknown_share, 1.0 / 3, 1e-12);
    EXPECT_NEAR(coverage[0].doubted_share, 1.0 / 3, 1e-12);
    EXPECT_NEAR(coverage[0].failed_share, 1.0 / 3, 0.01);  // a hundred times too far off
    EXPECT_GT(coverage[0].doubted_failures, 0.98);         // the others have twice the radius by chance
    EXPECT_LT(coverage[0].doubted_successes, 0.01);
    EXPECT_NEAR(coverage[0].held_95_shown, 0.95, 0.015);
    EXPECT_LT(coverage[0].held[2], 0.7);
    EXPECT_NEAR(coverage[1].held[2], 0.95, 0.02);
    EXPECT_NEAR(coverage[1].sharpness, 1, 0.1);  // radii of all rows are the same, and hold 95 %
    EXPECT_GT(coverage[0].sharpness, 10);
}

TEST(Coverage, TablesAreKeptAndBrokenOnesRefused) {
    const fs::path folder = tissuewarp::test::binary_folder() / "coverage_test";
    fs::remove_all(folder);
    fs::create_directories(folder);
    auto rows = drawn_rows(1);
    rows.resize(3);
    rows[1].evidence = Evidence::SurfaceAndPoints;
    rows[2].estimate.trust = registration::Trust::Carried;
    rows[2].in_view = false;
    rows[2].held_out_z = 1.25;
    write_coverage(folder / "phantom_1.csv", rows);
    const auto again = read_coverage(folder / "phantom_1.csv");
    ASSERT_EQ(again.size(), 3u);
    EXPECT_EQ(again[1].evidence, Evidence::SurfaceAndPoints);
    EXPECT_EQ(again[2].estimate.trust, registration::Trust::Carried);
    EXPECT_FALSE(again[2].in_view);
    EXPECT_EQ(again[2].held_out_z, 1.25);
    EXPECT_NEAR((again[0].error - rows[0].error).norm(), 0, 1e-4);
    EXPECT_LT((again[0].estimate.covariance - rows[0].estimate.covariance).norm(), 1e-5);

    std::ofstream(folder / "phantom_2.csv") << "seed,nonsense\n1,2\n";
    EXPECT_THROW(static_cast<void>(read_coverage(folder / "phantom_2.csv")), InvalidInput);
    std::ofstream(folder / "phantom_1.csv", std::ios::app) << "7,labels,1,0,1.0\n";
    EXPECT_THROW(static_cast<void>(read_coverage(folder / "phantom_1.csv")), InvalidInput);
    CoverageOptions backwards;
    std::swap(backwards.first_seed, backwards.last_seed);
    EXPECT_THROW(static_cast<void>(measured_coverage(folder, backwards)), InvalidInput);
}

TEST(Coverage, FigureNamesWhatItShows) {
    const std::string svg = coverage_figure(coverage_of(drawn_rows(1)));
    EXPECT_NE(svg.find("<svg"), std::string::npos);
    EXPECT_NE(svg.find("labels (4000 phantoms)"), std::string::npos);
    EXPECT_EQ(svg.find("nan"), std::string::npos);
}

// One phantom from end to end, twice: the second time read, not computed.
TEST(Coverage, APhantomIsMeasuredOnceAndKept) {
    const fs::path folder = tissuewarp::test::binary_folder() / "coverage_kept";
    fs::remove_all(folder);
    CoverageOptions options;
    options.first_seed = options.last_seed = 5;
    options.evidence = {Evidence::SurfaceAndPoints, Evidence::Points, Evidence::Surface};
    options.phantom.targets = 60;
    options.update.device = registration::Device::Cpu;
    const auto rows = measured_coverage(folder, options);
    ASSERT_GT(rows.size(), 160u);
    for (const CoverageRow& row : rows) {
        EXPECT_TRUE(row.error.allFinite());
        EXPECT_GT(row.least_det_j, 0.5);
        EXPECT_LT(row.least_det_j, 1);
        EXPECT_GT(row.estimate.deviation_mm, 0.30);  // 0.34 to 4.2, of the surface alone more
        EXPECT_LT(row.estimate.deviation_mm, row.evidence == Evidence::Surface ? 20 : 4.6);
        EXPECT_NEAR(row.estimate.interval_mm, registration::interval_mm(row.estimate, 0.95),
                    1e-3 * row.estimate.interval_mm);
        EXPECT_TRUE(row.evidence != Evidence::Surface || row.estimate.trust == registration::Trust::Unknown);
    }
    const auto kept = fs::last_write_time(folder / "phantom_5.csv");
    const auto read = measured_coverage(folder, options);
    ASSERT_EQ(read.size(), rows.size());
    EXPECT_NEAR(read.back().least_det_j, rows.back().least_det_j, 1e-5);
    EXPECT_EQ(fs::last_write_time(folder / "phantom_5.csv"), kept);
}

}  // namespace
}  // namespace tissuewarp::study
