#include "apps/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <utility>

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

/// The part of a verb's stage that a library's stage takes. Equilibria run within rounds, which count for them.
std::pair<double, double> share_of(std::string_view stage) {
    if (stage == "rigid alignment") return {0.0, 0.15};
    if (stage == "registration") return {0.15, 1.0};
    if (stage == "equilibrium") return {0.0, 0.0};
    if (stage == "rest stiffness") return {0.75, 1.0};
    return {0.0, 1.0};
}

}  // namespace

void catch_interrupts() {
    struct sigaction action {};
    action.sa_handler = request_stop;
    action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second one kills
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction before {};
        sigaction(signal, nullptr, &before);
        if (before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);  // nohup and shells ignore some for us
    }
}

bool interrupted() {
    return stop_requested;
}

ProgressLine::ProgressLine(const CommonOptions& options) {
    if (options.tells_progress()) tags_.emplace();
    if (options.quiet || isatty(STDERR_FILENO) != 1) return;
    const int own = dup(STDERR_FILENO);
    if (own >= 0) terminal_ = fdopen(own, "w");
}

ProgressLine::~ProgressLine() {
    clear();
    if (terminal_) std::fclose(terminal_);
}

void ProgressLine::begin(const std::string& stage, double from, double to) {
    {
        stage_ = stage;
        from_ = from;
        to_ = to;
        done_ = std::max(done_, from);
        last_ = {};
        if (tags_) tags_->begin(stage);
        draw();
    }
    if (interrupted()) throw Cancelled();
}

void ProgressLine::progress(std::string_view stage, double fraction) {
    const auto [from, to] = share_of(stage);
    const double part = from + (to - from) * std::clamp(fraction, 0.0, 1.0);
    done_ = std::max(done_, from_ + (to_ - from_) * part);  // never backwards
    draw();
}

void ProgressLine::note(std::string_view message) {
    if (std::find(notes_.begin(), notes_.end(), message) == notes_.end()) notes_.emplace_back(message);
}

void ProgressLine::draw() {
    if (tags_) tags_->progress(done_);
    const auto now = Clock::now();
    if (!terminal_ || now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    const double elapsed = std::chrono::duration<double>(now - start_).count();
    const std::string left =
        done_ > 0.02 ? "  about " + clock_text(elapsed * (1 - done_) / done_) + " left" : std::string();
    fmt::print(terminal_, "\r\x1b[K{:<24}{:>4.0f} %{}", stage_, 100 * done_, left);
    std::fflush(terminal_);
    dirty_ = true;
}

void ProgressLine::clear() {
    if (!dirty_) return;
    fmt::print(terminal_, "\r\x1b[K");
    std::fflush(terminal_);
    dirty_ = false;
}

}  // namespace tissuewarp::apps
