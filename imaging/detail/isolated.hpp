#pragma once
/// Decoders of other libraries, kept at a distance.

#include <cstddef>
#include <functional>

namespace tissuewarp::imaging::detail {

/// Fills `count` bytes at `target` by `decode`, which returns false where it cannot. It runs in two short-lived copies
/// of this process (fork without exec: no file, lock or thread of the caller is touched), whose fresh memory differs:
/// a decoder that ends by an assertion, a signal or not at all, or leaves bytes unwritten, gives false, and not the end
/// of the program or values that were in no file.
bool decode_isolated(const std::function<bool(char* bytes)>& decode, char* target, std::size_t count);

}  // namespace tissuewarp::imaging::detail
