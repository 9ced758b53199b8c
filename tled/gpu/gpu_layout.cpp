#include "tled/gpu/gpu_layout.hpp"

#include "tled/parallel/parallel.hpp"

#include "tled/material/kernel_parameters.hpp"

namespace tissuewarp::tled::detail {
namespace {

constexpr std::size_t nodes_at_once = 4096;  // of one task

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

/// Corner forces lie in four planes, one per corner.
std::vector<std::uint32_t> node_incidence(const RestState& rest) {
    const std::int64_t count = rest.element_count();
    std::vector<std::uint32_t> result(rest.incidence.offset.begin(), rest.incidence.offset.end());
    result.reserve(result.size() + rest.incidence.entry.size());
    for (const int entry : rest.incidence.entry)
        result.push_back(static_cast<std::uint32_t>(entry % 4 * count + entry / 4));
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
    elements.fibre = packed(rest.fibre);
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
    elements.node_incidence = node_incidence(rest);
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

std::vector<Float4> packed(const Eigen::Matrix3Xd& vectors) {
    std::vector<Float4> result(static_cast<std::size_t>(vectors.cols()));
    parallel_ranges(0, result.size(), nodes_at_once, [&](std::size_t begin, std::size_t end) {
        for (std::size_t a = begin; a < end; ++a) {
            const auto v = vectors.col(static_cast<Eigen::Index>(a));
            result[a] = {single(v[0]), single(v[1]), single(v[2]), 0.0F};
        }
    });
    return result;
}

Eigen::Matrix3Xd unpacked(std::span<const Float4> vectors) {
    Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(vectors.size()));
    parallel_ranges(0, vectors.size(), nodes_at_once, [&](std::size_t begin, std::size_t end) {
        for (std::size_t a = begin; a < end; ++a)
            result.col(static_cast<Eigen::Index>(a)) << vectors[a][0], vectors[a][1], vectors[a][2];
    });
    return result;
}

}  // namespace tissuewarp::tled::detail
