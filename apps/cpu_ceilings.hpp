#pragma once
/// What the processor can do at most: measured, to say which share of it an engine reaches.

#include "shaders/ceilings.hpp"

namespace tissuewarp::apps {

/// Best of several runs of a copy much larger than caches and of chains of multiply-adds with the widest instructions
/// of the machine, float32, on the threads that TBB may use here. Takes about a second.
shaders::Ceilings measured_cpu_ceilings();

}  // namespace tissuewarp::apps
