#pragma once
/// Whether a device computes what it should.

#include "tled/engine.hpp"

namespace tissuewarp::tled::detail {

/// Drivers have been seen to lose uploads without an error: one evaluation on the very mesh is compared with the scalar
/// forces before anything relies on the device. The engine ends at rest. Throws GpuUnavailable where they differ.
void require_right_forces(Engine& engine, const RestState& rest);

}  // namespace tissuewarp::tled::detail
