#include "tled/gpu/gpu_layout.hpp"

#include "tled/parallel/parallel.hpp"

#include "tled/material/kernel_parameters.hpp"

namespace tissuewarp::tled::detail {
namespace {

constexpr std::size_t nodes_at_once = 4096;  // of one task

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

/// Corner forces lie in four planes, one per corner, and behind them in eight planes of hexahedra. A node gathers those
/// of its tetrahedra, then those of its hexahedra.
std::vector<std::uint32_t> node_incidence(const RestState& rest) {
    const Incidence &tets = rest.incidence, &hexes = rest.hexahedra.incidence;
    const std::int64_t tet_count = rest.element_count(), hex_count = rest.hexahedra.count();
    const auto nodes = static_cast<std::size_t>(rest.node_count);
    std::vector<std::uint32_t> result;
    result.reserve(nodes + 1 + tets.entry.size() + hexes.entry.size());
    for (std::size_t a = 0; a <= nodes; ++a)
        result.push_back(static_cast<std::uint32_t>(tets.offset[a] + (hexes.offset.empty() ? 0 : hexes.offset[a])));
    for (std::size_t a = 0; a < nodes; ++a) {
        for (int k = tets.offset[a]; k < tets.offset[a + 1]; ++k) {
            const int entry = tets.entry[static_cast<std::size_t>(k)];
            result.push_back(static_cast<std::uint32_t>(entry % 4 * tet_count + entry / 4));
        }
        if (hexes.offset.empty()) continue;
        for (int k = hexes.offset[a]; k < hexes.offset[a + 1]; ++k) {
            const int entry = hexes.entry[static_cast<std::size_t>(k)];
            result.push_back(static_cast<std::uint32_t>(4 * tet_count + entry % 8 * hex_count + entry / 8));
        }
    }
    return result;
}

/// What chunks/element.hexahedron.glsl reads behind the data of tetrahedra.
void append_hexahedra(const HexState& hexahedra, GpuElements& elements) {
    const auto plane = static_cast<std::size_t>(hexahedra.count());
    const std::size_t first_node = elements.nodes.size(), first_rest = elements.rest.size();
    elements.nodes.resize(first_node + 2 * plane);
    elements.rest.resize(first_rest + 10 * plane);
    const std::vector<int> material = material_of_elements(hexahedra.blocks);
    for (int e = 0; e < hexahedra.count(); ++e) {
        const auto at = static_cast<std::size_t>(e);
        for (int corner = 0; corner < 8; ++corner)
            elements.nodes[first_node + static_cast<std::size_t>(corner / 4) * plane + at]
                          [static_cast<std::size_t>(corner % 4)] =
                static_cast<std::uint32_t>(hexahedra.nodes(corner, e));
        const std::array<double, 7> last{hexahedra.volume[e],
                                         static_cast<double>(material[at]),
                                         hexahedra.volumetric_modulus[e],
                                         hexahedra.hourglass_stiffness[e],
                                         0,
                                         0,
                                         0};
        for (std::size_t k = 0; k < 7; ++k) {
            const auto row = static_cast<Eigen::Index>(3 * k);
            elements.rest[first_rest + k * plane + at] = {single(hexahedra.gradient(row, e)),
                                                          single(hexahedra.gradient(row + 1, e)),
                                                          single(hexahedra.gradient(row + 2, e)), single(last[k])};
        }
        for (std::size_t j = 0; j < 3; ++j)
            for (std::size_t alpha = 0; alpha < 4; ++alpha)
                elements.rest[first_rest + (7 + j) * plane + at][alpha] =
                    single(hexahedra.rest_hourglass(static_cast<Eigen::Index>(3 * alpha + j), e));
    }
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
    const std::vector<Float4> hex_fibre = packed(rest.hexahedra.fibre);
    elements.fibre.insert(elements.fibre.end(), hex_fibre.begin(), hex_fibre.end());
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
    append_hexahedra(rest.hexahedra, elements);
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

Eigen::Matrix3Xd unpacked(const std::vector<Float4>& vectors) {
    Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(vectors.size()));
    parallel_ranges(0, vectors.size(), nodes_at_once, [&](std::size_t begin, std::size_t end) {
        for (std::size_t a = begin; a < end; ++a)
            result.col(static_cast<Eigen::Index>(a)) << vectors[a][0], vectors[a][1], vectors[a][2];
    });
    return result;
}

}  // namespace tissuewarp::tled::detail
