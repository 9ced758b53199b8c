#pragma once
/// Progress for people: one line on a terminal, nothing in a pipe; for 3D Slicer, tags. And the interrupt key.

#include "apps/filter_tags.hpp"
#include "apps/options.hpp"
#include "core/observer.hpp"

#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// From here on SIGINT, SIGTERM and SIGHUP ask the running verb to stop, unless the process was started with them
/// ignored; a second one ends the process at once.
void catch_interrupts();

/// True once an interrupt arrived.
bool interrupted();

/// An interrupt after which results remain: its text says which, and how to go on (exit code 130).
struct Interrupted : Error {
    using Error::Error;
};

/// Keeps notes, and draws "stage  percent  time left" on standard error when that is a terminal.
class ProgressLine final : public Observer {
public:
    explicit ProgressLine(const CommonOptions& options);
    ~ProgressLine() override;
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;

    /// A stage of the run, taking the part [from, to] of all the work: shares measured on a head, only for the percent.
    /// Throws Cancelled after an interrupt.
    void begin(const std::string& stage, double from, double to);

    void progress(std::string_view stage, double fraction) override;
    void note(std::string_view message) override;
    bool cancel_requested() override { return interrupted(); }

    [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

    /// Clears the line, before other output.
    void clear();

private:
    void draw();

    using Clock = std::chrono::steady_clock;
    std::FILE* terminal_ = nullptr;  // standard error of its own, which SilencedStandardError leaves alone; or null
    bool dirty_ = false;
    std::optional<FilterTags> tags_;  // on standard output, where 3D Slicer asks for them
    std::string stage_;
    double from_ = 0, to_ = 0, done_ = 0;
    Clock::time_point start_ = Clock::now(), last_{};
    std::vector<std::string> notes_;
};

}  // namespace tissuewarp::apps
