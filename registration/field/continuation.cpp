#include "registration/field/continuation.hpp"

#include "imaging/filters.hpp"
#include "imaging/sampling.hpp"
#include "meshing/search/surface_proximity.hpp"
#include "registration/field/continuation_grid.hpp"
#include "registration/field/rasterisation.hpp"

#include <tbb/parallel_for.h>

#include <cstdint>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

constexpr ContinuationOptions options;

}  // namespace

struct Continuation::Impl {
    Eigen::Vector3d lower;
    double spacing;
    ContinuationGrid grid;
    meshing::SurfaceProximity surface;
    std::optional<meshing::SurfaceProximity> sliding;  // the slip at it
    imaging::Volume body_distance;
    std::optional<imaging::LinearSampler> to_bodies;  // mm, where the surface slides
    HeldBodies bodies;

    Impl(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets, const meshing::BoundarySurface& boundary,
         const NodalField& field, double fade_mm, const HeldBodies& held, double finest_spacing_mm)
        : Impl(box_about(nodes, held.corners_of_moved()), nodes, tets, boundary, field.beside, fade_mm, held,
               finest_spacing_mm) {
        if (field.slip.cols() == 0) return;
        sliding.emplace(nodes, boundary, field.slip, options.slip_mm);
        measure_to_bodies();
    }

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

    void measure_to_bodies() {
        imaging::Geometry geometry;
        geometry.size = grid.size;
        geometry.spacing.setConstant(spacing);
        geometry.origin = lower;
        imaging::Volume held(geometry, CV_8UC1);
        bool any = false;
        for (std::size_t n = 0; n < grid.fixed.size(); ++n) {
            held.data<std::uint8_t>()[n] = grid.fixed[n] == in_body;
            any = any || grid.fixed[n] == in_body;
        }
        if (!any) return;
        body_distance = imaging::signed_distance(held);
        to_bodies.emplace(body_distance);
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

    /// What is added near the surface.
    [[nodiscard]] Eigen::Vector3d correction(const Eigen::Vector3d& point) const {
        const Eigen::Vector3d missed =
            fading(point, surface, [&](const meshing::SurfaceProximity::Hit& hit) { return missing(hit); });
        if (!sliding) return missed;
        const auto slip = sliding->closest(point);
        return slip ? Eigen::Vector3d(missed + share(slip->distance, room(point, *slip)) * slip->value) : missed;
    }

    /// Of the layer that slides, as far as a body that is held.
    [[nodiscard]] double room(const Eigen::Vector3d& point, const meshing::SurfaceProximity::Hit& hit) const {
        if (!to_bodies) return sliding->reach();
        return std::min(sliding->reach(), hit.distance + std::max(0.0, to_bodies->value(point)));
    }

    /// 1 at a surface, 0 at the end of a layer, slope 0 at both.
    static double share(double distance, double thickness) {
        const double t = thickness > 0 ? std::min(distance / thickness, 1.0) : 1.0;
        return (1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t);
    }

    /// What `value` is at the closest point of a surface, fading over its reach; in a narrow gap with that of the other
    /// side, each by the inverse of its distance, so that nothing jumps halfway.
    template <class Value>
    static Eigen::Vector3d fading(const Eigen::Vector3d& point, const meshing::SurfaceProximity& from,
                                  const Value& value) {
        const auto near = from.closest(point);
        if (!near) return Eigen::Vector3d::Zero();
        const double near_fading = share(near->distance, from.reach());
        const Eigen::Vector3d of_near = near_fading * value(*near);
        const auto opposite = from.closest_opposite(point, *near);
        if (!opposite) return of_near;
        const double opposite_fading = share(opposite->distance, from.reach());
        const double near_share = near_fading * opposite->distance, opposite_share = opposite_fading * near->distance;
        const double sum = near_share + opposite_share;
        if (!(sum > 0.0)) return of_near;
        return (near_share * of_near + opposite_share * opposite_fading * value(*opposite)) / sum;
    }
};

Continuation::Continuation(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets,
                           const meshing::BoundarySurface& boundary, const NodalField& field, double fade_mm,
                           const HeldBodies& bodies, double finest_spacing_mm)
    : impl_(std::make_unique<Impl>(nodes, tets, boundary, field, fade_mm, bodies, finest_spacing_mm)) {}
Continuation::~Continuation() = default;
Continuation::Continuation(Continuation&&) noexcept = default;
Continuation& Continuation::operator=(Continuation&&) noexcept = default;

Eigen::Vector3d Continuation::operator()(const Eigen::Vector3d& point) const {
    return impl_->interpolated(point) + impl_->correction(point);
}

}  // namespace tissuewarp::registration::detail
