#pragma once
/// What a reader asks of the heap. Without sanitizers every allocation of the process, of libraries too, is counted and
/// filled with a pattern: what shows in a result was never read. With them the sanitizer counts and poisons.

#include <cstddef>

namespace tissuewarp::fuzz {

/// From now on: counting begins at 0, new memory holds `pattern` (without sanitizers), and requests that would make
/// more than `most_bytes` alive at once fail.
void watch_allocations(std::size_t most_bytes, unsigned char pattern);
void stop_watching();

/// Most bytes alive at once since watching began.
std::size_t peak_bytes();
/// Bytes alive now that were not when watching began.
std::ptrdiff_t held_bytes();
/// The largest request that was turned down, or 0.
std::size_t refused_bytes();

}  // namespace tissuewarp::fuzz
