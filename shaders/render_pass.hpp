#pragma once
/// Render passes into textures: one fragment for each texel of the targets, no window and no geometry. Passes that read
/// what an earlier one wrote need no barrier: OpenGL orders them.

#include "shaders/program_source.hpp"
#include "shaders/texture.hpp"

#include <string>
#include <vector>

namespace tissuewarp::shaders {

/// Textures that a pass writes, all of one shape: its outputs 0, 1, … in this order. They must outlive it.
class Framebuffer {
public:
    /// One to eight targets. Throws InvalidInput for other numbers and for shapes that differ, GpuUnavailable when the
    /// device does not render to them.
    Framebuffer(const Device& device, const std::vector<const TextureStorage*>& targets);
    ~Framebuffer();
    Framebuffer(const Framebuffer&) = delete;
    Framebuffer& operator=(const Framebuffer&) = delete;

    /// Makes this, whole, what the next draws write.
    void bind() const;

private:
    const Device& device_;
    TextureShape shape_;
    unsigned id_ = 0;
};

/// A texture that a linked program samples.
struct Sampler {
    std::string name;
    int unit = 0;
};

/// A fragment stage behind render_pass/full_screen.vert. Uniforms have explicit locations. All members need the
/// device's context current, except construction and destruction, which make it so.
class FragmentProgram {
public:
    /// Throws GpuUnavailable with file:line and the compiler's words when the driver refuses the text.
    FragmentProgram(const Device& device, const ComposedSource& fragment);
    ~FragmentProgram();
    FragmentProgram(const FragmentProgram&) = delete;
    FragmentProgram& operator=(const FragmentProgram&) = delete;

    void set(int location, float value) const;
    /// Runs one fragment per texel. No texture that the program samples may be a target.
    void draw(const Framebuffer& target) const;

    [[nodiscard]] const std::vector<Sampler>& samplers() const { return samplers_; }

private:
    const Device& device_;
    unsigned id_ = 0;
    unsigned no_attributes_ = 0;
    std::vector<Sampler> samplers_;
};

}  // namespace tissuewarp::shaders
