#pragma once
/// The exceptions of tissuewarp. Every message states the value at fault, the limit it broke and the remedy.

#include <stdexcept>
#include <string>

namespace tissuewarp {

/// Base of every exception that tissuewarp throws on purpose.
struct Error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// The caller's data or parameters cannot be used: wrong geometry, empty label, non-finite value, ... (exit code 2).
struct InvalidInput : Error {
    using Error::Error;
};

/// A file cannot be read or written (exit code 3).
struct IoError : Error {
    using Error::Error;
};

/// The numerics did not reach an answer that can be trusted (exit code 4).
struct SolverFailure : Error {
    using Error::Error;
};

/// No usable OpenGL 4.5 device, or the device refused (exit code 5).
struct GpuUnavailable : Error {
    using Error::Error;
};

/// The observer asked to stop (exit code 130, as for an interrupt).
struct Cancelled : Error {
    Cancelled() : Error("cancelled") {}
};

}  // namespace tissuewarp
