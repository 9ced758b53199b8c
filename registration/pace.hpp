#pragma once
/// Rounds against a time budget.

#include <algorithm>
#include <chrono>

namespace tissuewarp::registration::detail {

struct PaceOptions {
    double longest = 4.0 / 3.0;  ///< that a round may take, over the one before. Chosen by hand; data not recorded
};
inline constexpr PaceOptions pace_options{};

class Pace {
public:
    /// The clock runs from now; 0: there is always room.
    explicit Pace(double budget_s) : budget_s_(budget_s) {}

    /// After each round.
    void lap() {
        const double now = elapsed();
        last_round_s_ = now - last_;
        last_ = now;
    }
    /// From here the rounds are timed.
    void begin_rounds() { last_ = elapsed(); }

    /// Whether so many rounds more fit, each at most a third longer than the last one.
    [[nodiscard]] bool room_for(int rounds) const {
        return budget_s_ <= 0 || elapsed() + rounds * pace_options.longest * last_round_s_ <= budget_s_;
    }

    /// Of the budget; 1 without one.
    [[nodiscard]] double share_left() const { return budget_s_ <= 0 ? 1 : 1 - elapsed() / budget_s_; }

private:
    using Clock = std::chrono::steady_clock;
    [[nodiscard]] double elapsed() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

    Clock::time_point start_ = Clock::now();
    double budget_s_, last_ = 0, last_round_s_ = 0;
};

}  // namespace tissuewarp::registration::detail
