/// The rounds as data: no solver runs here.
#include "registration/schedule.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration::detail {
namespace {

Round that_moved(double mm, int matched = 100, int held_back = 0) {
    Round round;
    round.largest_change_mm = mm;
    round.matched = matched;
    round.held_back = held_back;
    return round;
}

TEST(Schedule, RangesFallGeometricallyAndScalesWithThem) {
    UpdateOptions options;
    options.rematches = 5;
    options.first_range_mm = 16;
    options.last_range_mm = 1;
    options.residual_scale_mm = 0.7;
    const Schedule schedule(options, 0);
    ASSERT_EQ(schedule.count(), 5);
    const double ranges[] = {16, 8, 4, 2, 1}, scales[] = {1e6, 8 / 3.0, 4 / 3.0, 0.7, 0.7};
    for (int n = 0; n < 5; ++n) {
        EXPECT_NEAR(schedule.round(n).range_mm, ranges[n], 1e-12);
        EXPECT_NEAR(schedule.round(n).scale_mm, scales[n], 1e-9);
        EXPECT_EQ(schedule.round(n).number, n);
        EXPECT_EQ(schedule.round(n).last, n == 4);
        EXPECT_EQ(schedule.round(n).most_step_mm, options.most_step_mm);
    }
}

TEST(Schedule, SearchesAreSpreadOverTheRounds) {
    UpdateOptions options;
    options.rematches = 8;
    const Schedule schedule(options, 4);
    const int due[] = {1, 1, 2, 2, 3, 3, 4, 4};
    for (int n = 0; n < 8; ++n) EXPECT_EQ(schedule.round(n).searches_due, due[n]) << n;
    EXPECT_EQ(schedule.last_with_more_searches(2).searches_due, 6);
    EXPECT_TRUE(schedule.last_with_more_searches(2).last);
}

TEST(Schedule, OneRoundIsFirstAndLast) {
    UpdateOptions options;
    options.rematches = 1;
    const Schedule schedule(options, 2);
    ASSERT_EQ(schedule.count(), 1);
    EXPECT_TRUE(schedule.round(0).last);
    EXPECT_EQ(schedule.round(0).range_mm, options.last_range_mm);
    EXPECT_EQ(&schedule.last_but_one(), &schedule.last());
    EXPECT_EQ(schedule.after(0, that_moved(3)), 1);
}

TEST(Schedule, GoesOnByWhatARoundDid) {
    UpdateOptions options;  // eight rounds
    const Schedule plain(options, 0), searching(options, 4);
    EXPECT_EQ(plain.after(2, that_moved(1)), 3);
    EXPECT_EQ(plain.after(2, that_moved(1, 100, 3)), 2);  // more than 2 % held back: once more
    EXPECT_EQ(plain.after(2, that_moved(1, 100, 2)), 3);
    EXPECT_EQ(plain.after(2, that_moved(0.1)), 7);  // settled: the last round
    EXPECT_EQ(plain.after(7, that_moved(0.1)), 8);
    EXPECT_EQ(searching.after(0, that_moved(0.9)), 2);  // settled enough for the next search
    EXPECT_EQ(searching.after(0, that_moved(1.1)), 1);
    EXPECT_EQ(searching.after(6, that_moved(0.9)), 7);  // no search is left
}

}  // namespace
}  // namespace tissuewarp::registration::detail
