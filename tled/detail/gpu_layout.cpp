#include "tled/detail/gpu_layout.hpp"

#include "tled/detail/kernel_parameters.hpp"

namespace tissuewarp::tled::detail {
namespace {

float single(double value) {
    return static_cast<float>(value);
}

Uint4 column(const Eigen::Matrix4Xi& matrix, int index) {
    Uint4 result{};
    for (int corner = 0; corner < 4; ++corner)
        result[static_cast<std::size_t>(corner)] = static_cast<std::uint32_t>(matrix(corner, index));
    return result;
}

std::vector<Float4> material_parameters(const RestState& rest) {
    std::vector<Float4> result;
    for (const Material& material : rest.materials) {
        const KernelParameters p = kernel_parameters(material);
        result.push_back({single(p[0]), single(p[1]), single(p[2]), single(p[3])});
        result.push_back({single(p[4]), single(p[5]), single(p[6]), single(p[7])});
    }
    return result;
}

}  // namespace

GpuElements gpu_elements(const RestState& rest) {
    const int count = rest.element_count();
    const auto plane = static_cast<std::size_t>(count);
    GpuElements elements;
    elements.nodes.resize(plane);
    elements.rest.resize(3 * plane);
    elements.materials = material_parameters(rest);
    if (rest.fibre.size() > 0) elements.fibre = packed(rest.fibre);
    const std::vector<int> material = material_of_elements(rest);
    for (int e = 0; e < count; ++e) {
        const auto at = static_cast<std::size_t>(e);
        elements.nodes[at] = column(rest.nodes, e);
        const std::array<double, 3> last{rest.volume[e], static_cast<double>(material[at]), rest.volumetric_modulus[e]};
        for (std::size_t k = 0; k < 3; ++k) {
            const auto row = static_cast<Eigen::Index>(3 * k);
            elements.rest[k * plane + at] = {single(rest.gradient(row, e)), single(rest.gradient(row + 1, e)),
                                             single(rest.gradient(row + 2, e)), single(last[k])};
        }
    }
    elements.node_incidence.reserve(rest.incidence.offset.size() + rest.incidence.entry.size());
    for (const int offset : rest.incidence.offset)
        elements.node_incidence.push_back(static_cast<std::uint32_t>(offset));
    // Corner forces lie in four planes, one per corner.
    for (const int entry : rest.incidence.entry)
        elements.node_incidence.push_back(
            static_cast<std::uint32_t>((entry % 4) * static_cast<std::int64_t>(count) + entry / 4));
    return elements;
}

GpuPressure gpu_pressure(const RestState& rest) {
    const PressureNodes& nodes = rest.pressure;
    GpuPressure pressure;
    for (int a = 0; a < nodes.count(); ++a) {
        pressure.rest.push_back({single(1.0 / nodes.volume[a]), single(nodes.modulus[a])});
        const int material = nodes.material[static_cast<std::size_t>(a)];
        if (pressure.blocks.empty() || pressure.blocks.back().material != material)
            pressure.blocks.push_back({material, a, a});
        pressure.blocks.back().end = a + 1;
    }
    for (const int offset : nodes.incidence.offset) pressure.incidence.push_back(static_cast<std::uint32_t>(offset));
    for (const int entry : nodes.incidence.entry) pressure.incidence.push_back(static_cast<std::uint32_t>(entry / 4));
    for (int e = 0; e < rest.element_count(); ++e) pressure.corners.push_back(column(nodes.of_element, e));
    return pressure;
}

GpuSprings gpu_springs(const NodalConditions& conditions, int node_count) {
    GpuSprings result;
    result.index.assign(static_cast<std::size_t>(node_count), -1);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        result.index[static_cast<std::size_t>(conditions.spring_node[s])] = static_cast<std::int32_t>(s);
        const auto k = [&](int row) { return single(conditions.spring_stiffness(row, static_cast<Eigen::Index>(s))); };
        const auto f = [&](int row) { return single(conditions.spring_force(row, static_cast<Eigen::Index>(s))); };
        result.springs.push_back({{k(0), k(1), k(2), k(3)}, {k(4), k(5), f(0), f(1)}, {f(2), 0.0F, 0.0F, 0.0F}});
    }
    return result;
}

std::vector<Float4> packed(const Eigen::Matrix3Xd& vectors) {
    std::vector<Float4> result(static_cast<std::size_t>(vectors.cols()));
    for (Eigen::Index a = 0; a < vectors.cols(); ++a)
        result[static_cast<std::size_t>(a)] = {single(vectors(0, a)), single(vectors(1, a)), single(vectors(2, a)),
                                               0.0F};
    return result;
}

Eigen::Matrix3Xd unpacked(const std::vector<Float4>& vectors) {
    Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(vectors.size()));
    for (std::size_t a = 0; a < vectors.size(); ++a)
        for (std::size_t c = 0; c < 3; ++c)
            result(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(a)) = static_cast<double>(vectors[a][c]);
    return result;
}

}  // namespace tissuewarp::tled::detail
