#pragma once
/// Where dense forces are computed: on the processor, or in shaders on a device.

#include "registration/detail/dense_force.hpp"
#include "registration/detail/evidence.hpp"

#include <memory>

namespace tissuewarp::registration::detail {

/// What the fixed image says of a model in some state, asked again and again.
class DenseEngine {
public:
    virtual ~DenseEngine() = default;

    /// Forces on the moving grid of a level of the template, from the fixed image pulled back by the model's map
    /// φ(X) = placement · (X + u(X)). Within eight voxels outside the mesh φ continues what lies next to it.
    virtual DenseForces forces(const State& state, std::size_t level) = 0;
    /// The intraoperative image of the calls that follow.
    virtual void set_fixed(const SeenImage& fixed) = 0;
};

/// `prepared.image` is there, its template made of self-similarity descriptors; `prepared` outlives the engine.
std::unique_ptr<DenseEngine> make_cpu_dense_engine(const PreparedModel& prepared);

/// The same in shaders; `gpu_index` as for shaders::Device. The descriptors differ from the processor's by rounding: by
/// one of 255 steps in few channels. Throws GpuUnavailable when there is no device, or the images do not fit onto it.
std::unique_ptr<DenseEngine> make_gpu_dense_engine(const PreparedModel& prepared, int gpu_index = -1);

}  // namespace tissuewarp::registration::detail
