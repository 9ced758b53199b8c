#pragma once
/// For calls that run beside others, whose notes wait for their turn.

#include "core/cancel_only.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp {

/// Passes on requests to stop, keeps notes until they are told, and progress to itself. `whole` outlives it, and is
/// asked whether to stop by the thread that runs the call.
class KeptNotes final : public CancelOnly {
public:
    using CancelOnly::CancelOnly;
    void note(std::string_view message) override { notes_.emplace_back(message); }
    void tell(Observer& observer) const {
        for (const std::string& message : notes_) observer.note(message);
    }

private:
    std::vector<std::string> notes_;
};

}  // namespace tissuewarp
