#pragma once
/// What a step is made of, for people and for tests: nothing here names what a scene does not have.

#include <cstddef>
#include <string>
#include <vector>

namespace tissuewarp::tled {

struct StepBuffer {
    std::string name;
    std::size_t bytes = 0;
};

/// One pass of a step as an engine has composed it for its scene.
struct StepPass {
    std::string program;              ///< kernel of shaders/, or function of the CPU engine
    std::vector<std::string> parts;   ///< its chunks, or what its template is instantiated with
    std::vector<StepBuffer> buffers;  ///< that it reads or writes
    std::size_t invocations = 0;      ///< of a GPU; elements or nodes on a CPU
};

}  // namespace tissuewarp::tled
