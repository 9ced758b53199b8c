#pragma once
/// Where an intraoperative image is compared with the preoperative one: on the processor, or in shaders on a device.

#include "meshing/point_location.hpp"
#include "registration/matching/blocks/block_engine.hpp"
#include "registration/matching/dense/dense_force.hpp"
#include "registration/matching/ultrasound/echo_engine.hpp"
#include "registration/prepare.hpp"
#include "registration/state.hpp"

#include <memory>

namespace tissuewarp::registration::detail {

/// What the fixed image says of a model in some state, asked again and again.
class ImageEngine {
public:
    virtual ~ImageEngine() = default;

    /// The intraoperative image of the calls that follow.
    void set_fixed(const SeenImage& fixed) {
        begin_fixed(fixed.image);
        finish_fixed(fixed);
    }
    /// The same in two steps: what needs the image alone is begun before what it shows is known.
    virtual void begin_fixed(const imaging::Volume& image) = 0;
    virtual void finish_fixed(const SeenImage& fixed) = 0;
    /// Forces on the moving grid of a level of the template, from the fixed image pulled back by the model's map
    /// φ(X) = placement · (X + u(X)). Within eight voxels outside the mesh φ continues what lies next to it.
    virtual DenseForces forces(const State& state, std::size_t level) = 0;
    /// Looks for blocks in the fixed image.
    virtual BlockEngine& blocks() = 0;
    /// Compares it with ultrasound.
    virtual EchoEngine& echoes() = 0;
};

/// Of an image of the tissue that is meshed; both outlive the engine.
std::unique_ptr<ImageEngine> make_cpu_image_engine(const meshing::TetMesh& mesh, const ImageModel& image);

/// The same in shaders; `gpu_index` as for shaders::Device. The descriptors differ from the processor's by rounding: by
/// one of 255 steps in few channels. Throws GpuUnavailable when there is no device, the images do not fit onto it, or
/// blocks are too large for its sums.
std::unique_ptr<ImageEngine> make_gpu_image_engine(const meshing::TetMesh& mesh, const ImageModel& image,
                                                   int gpu_index = -1);

class TissueCubes;

/// What updates from one image after the other share: nothing that an image says.
struct ImageTools {
    std::unique_ptr<ImageEngine> engine;
    std::shared_ptr<const meshing::PointLocator> locator;  ///< in the model at rest
    SeenMemory memory;                                     ///< of the image in hand
    std::shared_ptr<const TissueCubes> cubes;              ///< of the moving image
};

}  // namespace tissuewarp::registration::detail
