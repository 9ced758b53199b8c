#pragma once
/// Which engine suits a model on this machine.

#include "core/observer.hpp"
#include "tled/engine.hpp"

#include <memory>

namespace tissuewarp::tled {

/// Whether this machine has a usable hardware GPU.
bool has_gpu();

/// A hardware GPU for models large enough to profit; the CPU (float32) for others, where there is none, and where it
/// cannot be trusted, of which the observer is told. `gpu_index` counts EGL devices; −1 takes the first.
std::unique_ptr<Engine> make_suitable_engine(const RestState& rest, int gpu_index = -1,
                                             Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
