#include "registration/field/continuation.hpp"

#include "imaging/filters.hpp"
#include "meshing/search/surface_proximity.hpp"
#include "registration/field/rasterisation.hpp"

#include <tbb/parallel_for.h>

#include <cstdint>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

using Vec4 = Eigen::Array4f;  // x, y, z and an unused fourth lane, so that one node is one SIMD register

constexpr ContinuationOptions options;

/// Why a node is fixed; 0 is free.
enum : std::uint8_t { in_mesh = 1, on_sheet, in_body, at_rest };

/// How the six neighbours of a free node beside the mesh are seen: a neighbour inside is replaced by the surface,
/// `fraction` of the spacing away (Shortley and Weller 1938).
struct SurfaceLinks {
    std::array<float, 6> fraction{1, 1, 1, 1, 1, 1};
    std::array<Vec4, 6> value{};  // where fraction < 1
};

/// Node values on a regular grid; fixed nodes are Dirichlet data.
struct Level {
    std::array<int, 3> size{};
    double spacing;
    std::vector<Vec4> value;
    std::vector<std::uint8_t> fixed;
    std::vector<float> stiffness;  // of free nodes; 0 where fixed
    std::vector<int> links_of;     // index into `links` or −1; empty when no node has links
    std::vector<SurfaceLinks> links;

    Level(const std::array<int, 3>& nodes, double spacing_mm) : size(nodes), spacing(spacing_mm) {
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

/// Calls visit(n) for the inner free nodes of one colour (0, 1) or of both (−1), in parallel.
template <class Visit>
void for_each_free(const Level& level, int colour, const Visit& visit) {
    tbb::parallel_for(1, level.size[2] - 1, [&](int k) {
        for (int j = 1; j < level.size[1] - 1; ++j) {
            const int first = colour < 0 ? 1 : 1 + (j + k + colour) % 2;
            for (int i = first; i < level.size[0] - 1; i += colour < 0 ? 1 : 2)
                if (const std::size_t n = level.at(i, j, k); !level.fixed[n]) visit(n);
        }
    });
}

/// 1 + (|∇u| / s)² at the free nodes, |∇u|² from the mean of the one-sided differences; averaged with the value before,
/// without which the alternation of weights and values oscillates.
void update_stiffness(Level& level) {
    const auto neighbours = level.neighbours();
    const float scale =
        static_cast<float>(0.5 / (level.spacing * level.spacing * options.stiffening * options.stiffening));
    level.stiffness.resize(level.value.size(), 0.0F);
    for_each_free(level, -1, [&](std::size_t n) {
        const Vec4* v = level.value.data() + n;
        const SurfaceLinks* links = level.links_at(n);
        Vec4 sum = Vec4::Zero();
        for (std::size_t e = 0; e < 6; ++e) {
            const bool cut = links && links->fraction[e] < 1.0F;
            const Vec4 difference =
                cut ? Vec4((links->value[e] - *v) / links->fraction[e]) : Vec4(v[neighbours[e]] - *v);
            sum += difference.square();
        }
        const float relative = scale * (sum[0] + sum[1] + sum[2]);
        const float wanted = 1.0F + relative;
        level.stiffness[n] = level.stiffness[n] > 0.0F ? 0.5F * (level.stiffness[n] + wanted) : wanted;
    });
}

/// One red-black sweep of successive over-relaxation; the border of the grid stays. An edge has the mean stiffness of
/// its ends, or of its free end.
void relax(Level& level, float omega) {
    const auto neighbours = level.neighbours();
    for (int colour = 0; colour < 2; ++colour) {
        for_each_free(level, colour, [&](std::size_t n) {
            const Vec4* v = level.value.data() + n;
            const float* stiffness = level.stiffness.data() + n;
            const SurfaceLinks* links = level.links_at(n);
            Vec4 sum = Vec4::Zero();
            float weights = 0.0F;
            for (std::size_t e = 0; e < 6; ++e) {
                const float other = stiffness[neighbours[e]];
                float weight = *stiffness + (other > 0.0F ? other : *stiffness);
                if (links && links->fraction[e] < 1.0F) {
                    weight /= links->fraction[e];
                    sum += weight * links->value[e];
                } else {
                    sum += weight * v[neighbours[e]];
                }
                weights += weight;
            }
            level.value[n] += omega * (sum / weights - *v);
        });
    }
}

Level coarsened(const Level& fine) {
    Level coarse({(fine.size[0] + 1) / 2, (fine.size[1] + 1) / 2, (fine.size[2] + 1) / 2}, 2.0 * fine.spacing);
    for (int k = 0; k < coarse.size[2]; ++k)
        for (int j = 0; j < coarse.size[1]; ++j)
            for (int i = 0; i < coarse.size[0]; ++i) {
                const std::size_t from = fine.at(2 * i, 2 * j, 2 * k), to = coarse.at(i, j, k);
                coarse.fixed[to] = fine.fixed[from];
                coarse.value[to] = fine.value[from];
            }
    return coarse;
}

/// Free nodes of the fine grid from the coarse one, trilinear.
void prolong(const Level& coarse, Level& fine) {
    tbb::parallel_for(0, fine.size[2], [&](int k) {
        for (int j = 0; j < fine.size[1]; ++j) {
            for (int i = 0; i < fine.size[0]; ++i) {
                const std::size_t n = fine.at(i, j, k);
                if (fine.fixed[n]) continue;
                Vec4 sum = Vec4::Zero();
                for (int corner = 0; corner < 8; ++corner) {
                    const auto half = [&](int index, int bit, int axis) {
                        return std::min((index + (corner >> bit & 1)) / 2, coarse.size[axis] - 1);
                    };
                    sum += coarse.value[coarse.at(half(i, 0, 0), half(j, 1, 1), half(k, 2, 2))];
                }
                fine.value[n] = 0.125F * sum;
            }
        }
    });
}

/// Minimises ∫ ½ |∇u|² + |∇u|⁴ / (4 s²): harmonic where gradients are small, and where harmonic functions would be
/// steep enough to fold (beside edges and narrow bumps) closer to the extension of least slope. Cascadic multigrid
/// (Bornemann and Deuflhard 1996): solved coarse to fine, each level starting from the one below. A few sweeps a level
/// suffice, because what is left is small and smooth.
void solve(Level& level) {
    const bool coarsest = *std::min_element(level.size.begin(), level.size.end()) < options.coarsest_nodes;
    if (!coarsest) {
        Level coarse = coarsened(level);
        solve(coarse);
        prolong(coarse, level);
    }
    const int rounds = coarsest ? options.coarsest_rounds : options.rounds;
    for (int round = 0; round < rounds; ++round) {
        update_stiffness(level);
        for (int sweep = 0; sweep < options.sweeps; ++sweep) relax(level, options.relaxation);
    }
}

}  // namespace

struct Continuation::Impl {
    Eigen::Vector3d lower;
    double spacing;
    Level grid;
    meshing::SurfaceProximity surface;
    HeldBodies bodies;

    Impl(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets, const meshing::BoundarySurface& boundary,
         const Eigen::Matrix3Xd& values, double fade_mm, const HeldBodies& held, double finest_spacing_mm)
        : Impl(box_about(nodes, held.corners_of_moved()), nodes, tets, boundary, values, fade_mm, held,
               finest_spacing_mm) {}

    /// `box`: lower and upper corner of the organ and of bodies that moved.
    Impl(const Eigen::Matrix<double, 3, 2>& box, const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets,
         const meshing::BoundarySurface& boundary, const Eigen::Matrix3Xd& values, double fade_mm,
         const HeldBodies& held, double finest_spacing_mm)
        : spacing(spacing_for(box, fade_mm, finest_spacing_mm)),
          grid(size_for(box, fade_mm), spacing),
          surface(nodes, boundary, values, options.blend_spacings * spacing),
          bodies(held) {
        lower = box.col(0).array() - fade_mm - 2.0 * spacing;
        const Eigen::Matrix3Xd index = (nodes.colwise() - lower) / spacing;
        fix_inside(index, tets, values);
        fix_thin_parts(index, boundary);
        fix_bodies();
        fix_far(index, boundary, fade_mm);
        link_surface();
        solve(grid);
    }

    static Eigen::Matrix<double, 3, 2> box_about(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix3Xd& others) {
        Eigen::Matrix<double, 3, 2> box;
        box << nodes.rowwise().minCoeff(), nodes.rowwise().maxCoeff();
        for (const auto& point : others.colwise()) {
            box.col(0) = box.col(0).cwiseMin(point);
            box.col(1) = box.col(1).cwiseMax(point);
        }
        return box;
    }
    static Eigen::Array3d extent_for(const Eigen::Matrix<double, 3, 2>& box, double fade_mm) {
        return (box.col(1) - box.col(0)).array() + 2.0 * fade_mm;
    }
    static double spacing_for(const Eigen::Matrix<double, 3, 2>& box, double fade_mm, double finest_spacing_mm) {
        return std::max(std::min(finest_spacing_mm, fade_mm / options.spacings_of_fade),
                        std::cbrt(extent_for(box, fade_mm).prod() / options.most_nodes));
    }
    [[nodiscard]] std::array<int, 3> size_for(const Eigen::Matrix<double, 3, 2>& box, double fade_mm) const {
        const Eigen::Array3d extent = extent_for(box, fade_mm) / spacing;
        const auto along = [&](int axis) { return static_cast<int>(std::ceil(extent[axis])) + 5; };
        return {along(0), along(1), along(2)};
    }

    /// Grid nodes inside the mesh take the finite-element field.
    void fix_inside(const Eigen::Matrix3Xd& index, const Eigen::Matrix4Xi& tets, const Eigen::Matrix3Xd& values) {
        rasterise(index, tets, grid.size, [&](int tet, const Eigen::Vector4d& barycentric_step) {
            const Eigen::Matrix<double, 3, 4> corners = values(Eigen::all, tets.col(tet));
            const Eigen::Vector3d step = corners * barycentric_step;
            return [&, corners, step](const TetRow& row) {
                const Eigen::Vector3d start = corners * row.at_first;
                for (int i = row.first; i <= row.last; ++i) {
                    const std::size_t n = grid.at(i, row.j, row.k);
                    if (grid.fixed[n]) continue;
                    grid.fixed[n] = in_mesh;
                    set(n, start + step * (i - row.first));
                }
            };
        });
    }

    /// A part of the mesh thinner than the spacing may hold no grid node: there the nearest ones take surface values.
    void fix_thin_parts(const Eigen::Matrix3Xd& index, const meshing::BoundarySurface& boundary) {
        std::vector<std::size_t> thin;
        for (const int node : boundary.node_of) {
            const Eigen::Vector3i nearest = index.col(node).array().round().cast<int>();
            const std::size_t n = grid.at(nearest[0], nearest[1], nearest[2]);
            bool alone = true;
            for (int k = -1; k <= 1; ++k)
                for (int j = -1; j <= 1; ++j)
                    for (int i = -1; i <= 1; ++i)
                        alone = alone && !grid.fixed[grid.at(nearest[0] + i, nearest[1] + j, nearest[2] + k)];
            if (!alone) continue;
            if (const auto hit = surface.closest(point_of(nearest))) {
                set(n, hit->value);
                thin.push_back(n);
            }
        }
        for (const std::size_t n : thin) grid.fixed[n] = on_sheet;
    }

    /// Grid nodes in rigid bodies move with them.
    void fix_bodies() {
        if (bodies.empty()) return;
        tbb::parallel_for(std::size_t{0}, grid.fixed.size(), [&](std::size_t n) {
            if (grid.fixed[n]) return;
            const Eigen::Vector3d point = point_of(index_of(n));
            const std::uint8_t body = bodies.at(point);
            if (body == 0) return;
            grid.fixed[n] = in_body;
            set(n, bodies.displacement(body, point));
        });
    }

    /// Cuts the edges from free nodes into the mesh at the surface.
    void link_surface() {
        const auto neighbours = grid.neighbours();
        std::vector<std::size_t> nodes;
        for (int k = 1; k < grid.size[2] - 1; ++k)
            for (int j = 1; j < grid.size[1] - 1; ++j)
                for (int i = 1; i < grid.size[0] - 1; ++i) {
                    const std::size_t n = grid.at(i, j, k);
                    if (grid.fixed[n]) continue;
                    bool beside = false;
                    for (const auto offset : neighbours) beside = beside || grid.fixed[n + offset] == in_mesh;
                    if (beside) nodes.push_back(n);
                }
        grid.links_of.assign(grid.value.size(), -1);
        grid.links.resize(nodes.size());
        tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t l) {
            const std::size_t n = nodes[l];
            const Eigen::Vector3d point = point_of(index_of(n));
            const auto free_end = surface.closest(point);
            for (std::size_t e = 0; free_end && e < 6; ++e) {
                if (grid.fixed[n + neighbours[e]] != in_mesh) continue;
                const Eigen::Vector3d edge = point_of(index_of(n + neighbours[e])) - point;
                const auto fixed_end = surface.closest(point + edge);
                if (!fixed_end) continue;
                // Where the distance to the surface, linear along the edge, vanishes.
                const double fraction = free_end->distance / std::max(free_end->distance + fixed_end->distance, 1e-9);
                const auto crossing = surface.closest(point + fraction * edge);
                if (!crossing) continue;
                grid.links[l].fraction[e] = static_cast<float>(std::clamp(fraction, 0.1, 0.999));
                grid.links[l].value[e].head<3>() = crossing->value.cast<float>();
            }
            grid.links_of[n] = static_cast<int>(l);
        });
    }

    /// Zero from the fade distance on.
    void fix_far(const Eigen::Matrix3Xd& index, const meshing::BoundarySurface& boundary, double fade_mm) {
        imaging::Geometry geometry;
        geometry.size = grid.size;
        geometry.spacing.setConstant(spacing);
        imaging::Volume mesh(geometry, CV_8UC1);
        std::copy(grid.fixed.begin(), grid.fixed.end(), mesh.data<std::uint8_t>());
        for (const int node : boundary.node_of) {  // a mesh between grid nodes has a distance too
            const Eigen::Vector3i nearest = index.col(node).array().round().cast<int>();
            mesh.data<std::uint8_t>()[grid.at(nearest[0], nearest[1], nearest[2])] = 1;
        }
        const imaging::Volume distance = imaging::signed_distance(mesh);
        for (std::size_t n = 0; n < grid.fixed.size(); ++n)
            if (distance.data<float>()[n] >= fade_mm) grid.fixed[n] = at_rest;
    }

    void set(std::size_t n, const Eigen::Vector3d& value) { grid.value[n].head<3>() = value.cast<float>(); }
    [[nodiscard]] Eigen::Vector3d point_of(const Eigen::Vector3i& node) const {
        return lower + spacing * node.cast<double>();
    }

    [[nodiscard]] Eigen::Vector3i index_of(std::size_t n) const {
        const std::size_t row = static_cast<std::size_t>(grid.size[0]), rows = static_cast<std::size_t>(grid.size[1]);
        return Eigen::Array<std::size_t, 3, 1>(n % row, n / row % rows, n / row / rows).cast<int>().matrix();
    }

    /// Trilinear value; zero outside the grid.
    [[nodiscard]] Eigen::Vector3d interpolated(const Eigen::Vector3d& point) const {
        const Eigen::Array3d index = (point - lower).array() / spacing;
        const Eigen::Array3d last(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
        if (!((index >= 0.0).all() && (index < last).all())) return Eigen::Vector3d::Zero();
        const Eigen::Array3i cell = index.cast<int>();
        const Eigen::Array3f f = (index - cell.cast<double>()).cast<float>();
        const std::size_t row = static_cast<std::size_t>(grid.size[0]);
        const std::size_t slice = row * static_cast<std::size_t>(grid.size[1]);
        const Vec4* v = grid.value.data() + grid.at(cell[0], cell[1], cell[2]);
        const auto along_i = [&](const Vec4* p) -> Vec4 { return p[0] + f[0] * (p[1] - p[0]); };
        const auto along_j = [&](const Vec4* p) -> Vec4 {
            const Vec4 near = along_i(p);
            return near + f[1] * (along_i(p + row) - near);
        };
        const Vec4 near = along_j(v);
        const Vec4 value = near + f[2] * (along_j(v + slice) - near);
        return value.head<3>().matrix().cast<double>();
    }

    /// What the grid misses of the surface's displacement at a point of it.
    [[nodiscard]] Eigen::Vector3d missing(const meshing::SurfaceProximity::Hit& hit) const {
        return hit.value - interpolated(hit.point);
    }

    /// What is missing at the closest point of the surface, fading over the layer; in a narrow gap with that of the
    /// other side, each by the inverse of its distance, so that nothing jumps halfway.
    [[nodiscard]] Eigen::Vector3d correction(const Eigen::Vector3d& point) const {
        const auto near = surface.closest(point);
        if (!near) return Eigen::Vector3d::Zero();
        const auto fading = [&](const meshing::SurfaceProximity::Hit& hit) {
            const double t = hit.distance / surface.reach();
            return (1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t);  // 1 at the surface, slope 0 at both ends
        };
        const double near_fading = fading(*near);
        const Eigen::Vector3d of_near = near_fading * missing(*near);
        const auto opposite = surface.closest_opposite(point, *near);
        if (!opposite) return of_near;
        const double opposite_fading = fading(*opposite);
        const double near_share = near_fading * opposite->distance, opposite_share = opposite_fading * near->distance;
        const double sum = near_share + opposite_share;
        if (!(sum > 0.0)) return of_near;
        return (near_share * of_near + opposite_share * opposite_fading * missing(*opposite)) / sum;
    }
};

Continuation::Continuation(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets,
                           const meshing::BoundarySurface& boundary, const Eigen::Matrix3Xd& values, double fade_mm,
                           const HeldBodies& bodies, double finest_spacing_mm)
    : impl_(std::make_unique<Impl>(nodes, tets, boundary, values, fade_mm, bodies, finest_spacing_mm)) {}
Continuation::~Continuation() = default;
Continuation::Continuation(Continuation&&) noexcept = default;
Continuation& Continuation::operator=(Continuation&&) noexcept = default;

Eigen::Vector3d Continuation::operator()(const Eigen::Vector3d& point) const {
    return impl_->interpolated(point) + impl_->correction(point);
}

}  // namespace tissuewarp::registration::detail
