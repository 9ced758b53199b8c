#pragma once
/// Whether a device offers what the solver needs, and computes what it should.

#include "shaders/device.hpp"
#include "tled/engine.hpp"

namespace tissuewarp::tled::detail {

/// Throws GpuUnavailable where it has too few storage blocks.
void require_limits(const shaders::Device& device);

/// Drivers have been seen to lose uploads without an error: one evaluation on the very mesh is compared with the scalar
/// forces before anything relies on the device. The engine ends at rest. Throws GpuUnavailable where they differ.
void require_right_forces(Engine& engine, const RestState& rest);

}  // namespace tissuewarp::tled::detail
