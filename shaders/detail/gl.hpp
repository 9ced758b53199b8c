#pragma once
/// What all files of shaders/ that call OpenGL share.

#include "core/errors.hpp"
#include "shaders/device.hpp"

#include <epoxy/gl.h>

#include <string>

namespace tissuewarp::shaders::detail {

/// Collects the driver's error messages of a debug context, synchronously.
void collect_debug_messages();
/// Messages collected on this thread since the last call.
std::string take_debug_messages();

/// For destructors: calls `release` with the context current. Where another thread holds the context, which no caller
/// may let happen, the object stays until the context goes rather than ending the process.
template <class Release>
void release_with_context(const Device& device, Release release) noexcept {
    try {
        const CurrentContext current = device.make_current();
        release();
    } catch (const GpuUnavailable&) {
    }
}

}  // namespace tissuewarp::shaders::detail
