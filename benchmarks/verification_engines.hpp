#pragma once
/// Engines against Newton's method, for verification_table.

namespace tissuewarp::verification {

enum class GpuRows { Omit, Print };

/// Prints a Markdown table: problems of data/reference on one mesh each, T4 and averaged pressure, the largest
/// displacement difference between every engine's equilibrium and Newton's method.
void print_engines(GpuRows gpu);

}  // namespace tissuewarp::verification
