#pragma once
/// The step in two render passes over textures, as graphics hardware of 2007 had to do it (Taylor, Cheng, Ourselin,
/// MICCAI 2007): the historical baseline that the engines of engine.hpp are timed against, for one kind of scene.

#include "tled/conditions.hpp"
#include "tled/engine.hpp"

#include <Eigen/Core>

#include <memory>
#include <string>

namespace tissuewarp::tled {

/// Linear tetrahedra of one neo-Hookean law, imposed displacements, float32. State: displacement u and increment u − u⁻
/// (3 × N, mm). Unlike in the paper the increment is kept instead of u⁻: in float32 the difference of two displacements
/// drifts.
class RenderPassEngine {
public:
    /// Of the conditions `constrained` and `imposed` are taken; `mass` is diagonal, 3 × N, kg; `device` counts EGL
    /// devices, −1 takes the first hardware device, or the software rasteriser when there is none. The state is zero
    /// but for what is imposed. Throws InvalidInput for what the passes do not know (another law, several laws,
    /// averaged pressure, viscosity, springs, external forces), for wrong shapes and for masses that are
    /// not positive, and GpuUnavailable.
    RenderPassEngine(const RestState& rest, const NodalConditions& conditions, const Eigen::Matrix3Xd& mass,
                     int device = -1);
    ~RenderPassEngine();

    /// Imposed components keep their imposed displacement and increment zero. Throws InvalidInput for wrong shapes.
    void set_state(const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& increment);
    /// Advances by `steps` without any transfer between host and device.
    void run(int steps, const StepCoefficients& coefficients);

    [[nodiscard]] Eigen::Matrix3Xd displacement() const;
    [[nodiscard]] Eigen::Matrix3Xd increment() const;
    /// For reports: "GPU NVIDIA H100 (OpenGL 4.5), render passes".
    [[nodiscard]] std::string description() const;

private:
    class Passes;
    std::unique_ptr<Passes> passes_;
};

}  // namespace tissuewarp::tled
