#pragma once
/// How long-running library calls report progress and learn that they should stop. Libraries never log.

#include "core/errors.hpp"

#include <string_view>

namespace tissuewarp {

/// Receives progress from a long call. The default does nothing, so `Observer{}` is the silent observer.
class Observer {
public:
    virtual ~Observer() = default;

    /// `stage` names what runs, `fraction` in [0, 1] says how much of it is done. Called by the thread that called the library.
    virtual void progress(std::string_view /*stage*/, double /*fraction*/) {}

    /// One line worth telling a person: a choice made, a doubt. Not for progress.
    virtual void note(std::string_view /*message*/) {}

    /// Polled between units of work; true ends the call with `Cancelled`.
    virtual bool cancel_requested() { return false; }

    /// Reports progress and throws `Cancelled` when a stop was requested.
    void checkpoint(std::string_view stage, double fraction) {
        progress(stage, fraction);
        if (cancel_requested()) throw Cancelled();
    }
};

/// The observer used where the caller passes none.
inline Observer& silent_observer() {
    static Observer observer;
    return observer;
}

}  // namespace tissuewarp
