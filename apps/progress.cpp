#include "apps/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>

namespace tissuewarp::apps {

namespace {

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may write lock-free atomics only");

extern "C" void request_stop(int) {
    stop_requested = true;
}

std::string clock_text(double seconds) {
    const int whole = static_cast<int>(seconds + 0.5);
    return fmt::format("{}:{:02d}", whole / 60, whole % 60);
}

}  // namespace

void catch_interrupts() {
    struct sigaction action {};
    action.sa_handler = request_stop;
    action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second one kills
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

bool interrupted() {
    return stop_requested;
}

ProgressLine::ProgressLine(bool quiet) : drawn_(!quiet && isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
    clear();
}

void ProgressLine::begin(const std::string& stage, double from, double to) {
    {
        const std::lock_guard lock(mutex_);
        stage_ = stage;
        from_ = from;
        to_ = to;
        done_ = std::max(done_, from);
        last_ = {};
        draw();
    }
    if (interrupted()) throw Cancelled();
}

void ProgressLine::progress(std::string_view, double fraction) {
    const std::lock_guard lock(mutex_);
    // Stages nest (rounds hold equilibria), so the line only ever moves forward.
    done_ = std::max(done_, from_ + (to_ - from_) * std::clamp(fraction, 0.0, 1.0));
    draw();
}

void ProgressLine::note(std::string_view message) {
    const std::lock_guard lock(mutex_);
    notes_.emplace_back(message);
}

void ProgressLine::draw() {
    const auto now = Clock::now();
    if (!drawn_ || now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    const double elapsed = std::chrono::duration<double>(now - start_).count();
    const std::string left =
        done_ > 0.02 ? "  about " + clock_text(elapsed * (1 - done_) / done_) + " left" : std::string();
    fmt::print(stderr, "\r\x1b[K{:<24}{:>4.0f} %{}", stage_, 100 * done_, left);
    std::fflush(stderr);
    dirty_ = true;
}

void ProgressLine::clear() {
    const std::lock_guard lock(mutex_);
    if (dirty_) fmt::print(stderr, "\r\x1b[K");
    std::fflush(stderr);
    dirty_ = false;
}

}  // namespace tissuewarp::apps
