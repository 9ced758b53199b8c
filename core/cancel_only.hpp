#pragma once
/// For calls within a call, whose stages are not those of the whole.

#include "core/observer.hpp"

namespace tissuewarp {

/// Passes on requests to stop; keeps progress and notes to itself. `whole` outlives it.
class CancelOnly : public Observer {
public:
    explicit CancelOnly(Observer& whole) : whole_(whole) {}
    bool cancel_requested() override { return whole_.cancel_requested(); }

private:
    Observer& whole_;
};

}  // namespace tissuewarp
