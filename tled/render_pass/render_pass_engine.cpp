#include "tled/render_pass/render_pass_engine.hpp"

#include "core/errors.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/render_pass.hpp"
#include "tled/render_pass/render_pass_layout.hpp"

#include <cmath>
#include <map>
#include <stdexcept>

namespace tissuewarp::tled {
namespace {

using detail::Float4;
using detail::RenderPassLayout;
using detail::RenderPassShapes;
using Eigen::Matrix3Xd;
using shaders::CurrentContext;
using shaders::FragmentProgram;
using shaders::Framebuffer;
using shaders::Law;
using shaders::Texture;
using shaders::TextureStorage;
using Mask = Eigen::Matrix<bool, 3, Eigen::Dynamic>;

/// Recorded steps are handed over in portions of this many, so that the device starts while the host still records.
constexpr int steps_per_flush = 64;

void refuse_if(bool unknown, const std::string& what) {
    if (unknown) throw InvalidInput("the render passes of 2007 do not know " + what + "; take make_gpu_engine()");
}

void require_columns(const Matrix3Xd& matrix, int node_count, const char* what) {
    if (matrix.cols() != node_count)
        throw InvalidInput(std::string(what) + " has " + std::to_string(matrix.cols()) + " columns; the model has " +
                           std::to_string(node_count) + " nodes");
}

bool is_neo_hookean(const Material& material) {
    return std::holds_alternative<NeoHookeanIso>(material) || std::holds_alternative<NeoHookeanLnJ>(material) ||
           std::holds_alternative<NeoHookeanStable>(material);
}

void require_known(const RestState& rest) {
    refuse_if(rest.pressure.count() > 0, "averaged pressure");
    refuse_if(!rest.viscosity.empty(), "viscosity");
    for (const Material& material : rest.materials) {
        refuse_if(!is_neo_hookean(material), "the law " + law_name(material) + ", only neo-Hookean ones");
        refuse_if(material.index() != rest.materials.front().index(), "several laws in one scene");
    }
}

void require_known(const NodalConditions& conditions, int node_count) {
    refuse_if(!conditions.spring_node.empty(), "springs");
    refuse_if(conditions.external_force.size() > 0 && !conditions.external_force.isZero(0.0), "external forces");
    if (conditions.constrained.cols() != node_count)
        throw InvalidInput("the conditions are for " + std::to_string(conditions.constrained.cols()) +
                           " nodes; the model has " + std::to_string(node_count));
    require_columns(conditions.imposed, node_count, "the imposed displacement");
}

/// Inverse mass zero holds a component: it needs no mask and no branch in the step.
Matrix3Xd inverse_mass(const Matrix3Xd& mass, const Mask& constrained) {
    require_columns(mass, static_cast<int>(constrained.cols()), "the mass");
    for (Eigen::Index i = 0; i < mass.size(); ++i)
        if (const double m = mass.reshaped()[i]; !(m > 0) || !std::isfinite(m))
            throw InvalidInput("the mass of node " + std::to_string(i / 3) + " is " + std::to_string(m) +
                               "; it must be positive");
    return constrained.select(Matrix3Xd::Zero(3, mass.cols()), mass.cwiseInverse());
}

RenderPassShapes shapes_of(const shaders::Device& device, const RestState& rest) {
    const auto elements = static_cast<std::size_t>(rest.element_count());
    return {shaders::texture_shape(device, elements, "elements"),
            shaders::texture_shape(device, static_cast<std::size_t>(rest.node_count), "nodes"),
            shaders::texture_shape(device, 4 * elements, "corners of elements")};
}

/// What the passes read and never write, by the names of the samplers.
struct RestTextures {
    RestTextures(const shaders::Device& device, const RenderPassLayout& layout, const Matrix3Xd& inverse)
        : element_nodes(device, layout.element_nodes, "nodes of elements"),
          rest_1(device, layout.rest[0], "rest data of elements"),
          rest_2(device, layout.rest[1], "rest data of elements"),
          rest_3(device, layout.rest[2], "rest data of elements"),
          materials(device, layout.materials, "material parameters"),
          node_elements(device, layout.node_elements, "valences of nodes"),
          force_coordinates(device, layout.force_coordinates, "corners of nodes"),
          inverse_mass(device, detail::packed(inverse), "inverse masses") {}
    Texture<detail::Uint4> element_nodes;
    Texture<Float4> rest_1, rest_2, rest_3, materials;
    Texture<detail::Uint2> node_elements;
    Texture<std::uint32_t> force_coordinates;
    Texture<Float4> inverse_mass;
};

/// Displacement and increment: one pair is read while the other is written.
struct StateTextures {
    StateTextures(const shaders::Device& device, std::size_t nodes)
        : displacement(device, nodes, "displacements"),
          increment(device, nodes, "increments"),
          target(device, {&displacement, &increment}) {}
    Texture<Float4> displacement, increment;
    Framebuffer target;
};

struct ForceTextures {
    ForceTextures(const shaders::Device& device, std::size_t elements)
        : corner_0(device, elements, "corner forces"),
          corner_1(device, elements, "corner forces"),
          corner_2(device, elements, "corner forces"),
          corner_3(device, elements, "corner forces"),
          target(device, {&corner_0, &corner_1, &corner_2, &corner_3}) {}
    Texture<Float4> corner_0, corner_1, corner_2, corner_3;
    Framebuffer target;
};

}  // namespace

class RenderPassEngine::Passes {
public:
    Passes(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& inverse, int device)
        : device_(device),
          rest_(device_, detail::render_pass_layout(rest, shapes_of(device_, rest)), inverse),
          force_(device_, static_cast<std::size_t>(rest.element_count())),
          state_a_(device_, static_cast<std::size_t>(rest.node_count)),
          state_b_(device_, static_cast<std::size_t>(rest.node_count)),
          element_forces_(device_, shaders::compose(
                                       shaders::element_forces_pass(static_cast<Law>(rest.materials.front().index())))),
          node_step_(device_, shaders::compose(shaders::node_step_pass())),
          constrained_(conditions.constrained),
          imposed_(conditions.imposed),
          displacement_unit_(unit_of("displacement")),
          increment_unit_(unit_of("increment")) {
        const CurrentContext current = device_.make_current();
        bind_what_stays(element_forces_);
        bind_what_stays(node_step_);
        const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
        set_state(zero, zero);
    }

    void set_state(const Matrix3Xd& displacement, const Matrix3Xd& increment) {
        const auto node_count = static_cast<int>(constrained_.cols());
        require_columns(displacement, node_count, "the displacement");
        require_columns(increment, node_count, "the increment");
        const CurrentContext current = device_.make_current();
        const Matrix3Xd u = constrained_.select(imposed_, displacement);
        const Matrix3Xd v = constrained_.select(Matrix3Xd::Zero(3, node_count), increment);
        now_->displacement.upload(detail::packed(u));
        now_->increment.upload(detail::packed(v));
    }

    void run(int steps, const StepCoefficients& coefficients) {
        const CurrentContext current = device_.make_current();
        node_step_.set(0, static_cast<float>(coefficients.momentum));
        node_step_.set(1, static_cast<float>(coefficients.gain));
        for (int i = 1; i <= steps; ++i) {
            now_->displacement.bind(displacement_unit_);
            now_->increment.bind(increment_unit_);
            element_forces_.draw(force_.target);
            node_step_.draw(next_->target);
            std::swap(now_, next_);
            if (i % steps_per_flush == 0) shaders::flush();
        }
        shaders::check_errors("time steps");
    }

    [[nodiscard]] Matrix3Xd displacement() const { return downloaded(now_->displacement); }
    [[nodiscard]] Matrix3Xd increment() const { return downloaded(now_->increment); }

    [[nodiscard]] std::string description() const {
        return "GPU " + device_.renderer() + " (OpenGL " + device_.version().substr(0, 3) + "), render passes";
    }

private:
    /// Unit of a texture that the node pass samples; the element pass has it on the same.
    [[nodiscard]] int unit_of(const std::string& name) const {
        for (const shaders::Sampler& sampler : node_step_.samplers())
            if (sampler.name == name) return sampler.unit;
        throw std::logic_error("the node pass samples no texture " + name);
    }

    /// The units of all samplers differ, so that one binding serves both passes and every run.
    void bind_what_stays(const FragmentProgram& program) const {
        const std::map<std::string, const TextureStorage*> textures{
            {"element_nodes", &rest_.element_nodes},   {"element_rest_1", &rest_.rest_1},
            {"element_rest_2", &rest_.rest_2},         {"element_rest_3", &rest_.rest_3},
            {"material_parameters", &rest_.materials}, {"node_elements", &rest_.node_elements},
            {"inverse_mass", &rest_.inverse_mass},     {"force_coordinates", &rest_.force_coordinates},
            {"corner_force_0", &force_.corner_0},      {"corner_force_1", &force_.corner_1},
            {"corner_force_2", &force_.corner_2},      {"corner_force_3", &force_.corner_3},
        };
        for (const shaders::Sampler& sampler : program.samplers()) {
            if (sampler.unit == displacement_unit_ || sampler.unit == increment_unit_) continue;
            const auto found = textures.find(sampler.name);
            if (found == textures.end()) throw std::logic_error("no texture serves the sampler " + sampler.name);
            found->second->bind(sampler.unit);
        }
    }

    [[nodiscard]] Matrix3Xd downloaded(const Texture<Float4>& texture) const {
        const CurrentContext current = device_.make_current();
        return detail::unpacked(texture.download());
    }

    shaders::Device device_;
    RestTextures rest_;
    ForceTextures force_;
    StateTextures state_a_, state_b_;
    StateTextures *now_ = &state_a_, *next_ = &state_b_;
    FragmentProgram element_forces_, node_step_;
    Mask constrained_;
    Matrix3Xd imposed_;
    int displacement_unit_, increment_unit_;
};

RenderPassEngine::RenderPassEngine(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& mass,
                                   int device) {
    require_known(rest);
    require_known(conditions, rest.node_count);
    passes_ = std::make_unique<Passes>(rest, conditions, inverse_mass(mass, conditions.constrained), device);
}

RenderPassEngine::~RenderPassEngine() = default;

void RenderPassEngine::set_state(const Matrix3Xd& displacement, const Matrix3Xd& increment) {
    passes_->set_state(displacement, increment);
}

void RenderPassEngine::run(int steps, const StepCoefficients& coefficients) {
    passes_->run(steps, coefficients);
}

Matrix3Xd RenderPassEngine::displacement() const {
    return passes_->displacement();
}

Matrix3Xd RenderPassEngine::increment() const {
    return passes_->increment();
}

std::string RenderPassEngine::description() const {
    return passes_->description();
}

}  // namespace tissuewarp::tled
