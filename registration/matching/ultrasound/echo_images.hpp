#pragma once
/// Ultrasound and what a preoperative image lets expect of it, on one working grid.

#include "registration/matching/descriptors/matching_image.hpp"
#include "registration/state.hpp"

#include "meshing/tet_mesh.hpp"

#include <map>

namespace tissuewarp::registration::detail {

/// Values of a working grid, i fastest; all of mean 0 about each place and of deviation 1.
struct EchoImages {
    imaging::Geometry grid;
    std::vector<float> echo;            ///< of the ultrasound pulled back to the grid; 0 where it is not seen
    std::vector<float> seen;            ///< 1 where the ultrasound shows tissue, 0 elsewhere
    std::vector<float> grey, gradient;  ///< of the moving image, and the magnitude of its gradient
    std::vector<float> shown;           ///< 1 where the moving image shows something
};

/// How both images are smoothed. Chosen on `study coverage --problems ultrasound:1-12` (docs/decisions/ultrasound.md).
struct EchoImageOptions {
    double speckle_mm = 1.0;       ///< deviation of the smoothing that averages speckle
    double moving_mm = 0.7;        ///< of the moving image's before its gradient
    double trend_mm = 8;           ///< what varies over more than this is the scanner's: gain, near field, bias
    double outside_mm = 3;         ///< tissue beyond the mesh that counts
    double margin_mm = 25;         ///< of the moving image about the organ
    double least_amplitude = 0.3;  ///< of the local deviation, over that of the image: flat regions are not raised
};

class EchoSource {
public:
    /// Of a moving image of the tissue that is meshed, and what the fixed one shows; all outlive this.
    EchoSource(const meshing::TetMesh& mesh, const imaging::Volume& moving, const SeenImage& fixed,
               const EchoImageOptions& options = {});

    /// On an isotropic grid along the moving image's axes, `margin_mm` about what the ultrasound shows of the model in
    /// some state.
    /// Throws InvalidInput where it shows nothing of it.
    [[nodiscard]] EchoImages on_grid(const State& state, double spacing_mm, double margin_mm);

private:
    /// For one spacing of working grids.
    struct Level {
        imaging::Volume echo;            // smoothed, on the ultrasound's own grid
        imaging::Volume grey, gradient;  // on the moving image's
    };

    const meshing::TetMesh& mesh_;
    const SeenImage& fixed_;
    EchoImageOptions options_;
    imaging::Volume grey_, gradient_;  // of the moving image near the organ, smoothed by moving_mm
    std::map<double, Level> levels_;

    const Level& level(double spacing_mm);
};

}  // namespace tissuewarp::registration::detail
