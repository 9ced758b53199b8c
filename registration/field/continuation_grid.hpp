#pragma once
/// The grid that a continued field is solved on.

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

using Vec4 = Eigen::Array4f;  // x, y, z and an unused fourth lane, so that one node is one SIMD register

/// Why a node is fixed; 0 is free.
enum : std::uint8_t { in_mesh = 1, on_sheet, in_body, at_rest };

/// How the six neighbours of a free node beside the mesh are seen: a neighbour inside is replaced by the surface,
/// `fraction` of the spacing away (Shortley and Weller 1938).
struct SurfaceLinks {
    std::array<float, 6> fraction{1, 1, 1, 1, 1, 1};
    std::array<Vec4, 6> value{};  // where fraction < 1
};

/// Node values on a regular grid; fixed nodes are Dirichlet data.
struct ContinuationGrid {
    std::array<int, 3> size{};
    double spacing;
    std::vector<Vec4> value;
    std::vector<std::uint8_t> fixed;
    std::vector<float> stiffness;  // of free nodes; 0 where fixed
    std::vector<int> links_of;     // index into `links` or −1; empty when no node has links
    std::vector<SurfaceLinks> links;

    ContinuationGrid(const std::array<int, 3>& nodes, double spacing_mm) : size(nodes), spacing(spacing_mm) {
        const std::size_t count =
            static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(size[2]);
        value.assign(count, Vec4::Zero());
        fixed.assign(count, 0);
    }
    [[nodiscard]] std::size_t at(int i, int j, int k) const {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(size[0]) *
                   (static_cast<std::size_t>(j) + static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(k));
    }
    /// Offsets to the neighbours −i, +i, −j, +j, −k, +k.
    [[nodiscard]] std::array<std::ptrdiff_t, 6> neighbours() const {
        const std::ptrdiff_t row = size[0], slice = row * size[1];
        return {-1, 1, -row, row, -slice, slice};
    }
    [[nodiscard]] const SurfaceLinks* links_at(std::size_t n) const {
        return links.empty() || links_of[n] < 0 ? nullptr : &links[static_cast<std::size_t>(links_of[n])];
    }
};

/// Minimises ∫ ½ |∇u|² + |∇u|⁴ / (4 s²): harmonic where gradients are small, and where harmonic functions would be
/// steep enough to fold (beside edges and narrow bumps) closer to the extension of least slope. Cascadic multigrid
/// (Bornemann and Deuflhard 1996): solved coarse to fine, each level starting from the one below. A few sweeps a level
/// suffice, because what is left is small and smooth.
void solve(ContinuationGrid& level);

}  // namespace tissuewarp::registration::detail
