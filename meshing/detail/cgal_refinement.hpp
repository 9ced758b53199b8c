#pragma once
/// The one place that knows CGAL, for either of its concurrency tags. A translation unit instantiates one tag:
/// compiling one takes 3.5 GB.

#include "meshing/detail/delaunay_refinement.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/make_mesh_3.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <unordered_map>

namespace tissuewarp::meshing::detail {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Domain = CGAL::Labeled_mesh_domain_3<Kernel>;
template <class Concurrency>
using Triangulation = typename CGAL::Mesh_triangulation_3<Domain, Kernel, Concurrency>::type;
template <class Concurrency>
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation<Concurrency>>;
using Point = Kernel::Point_3;

/// CGAL's criteria, but facets whose surface ball is already small stay as they are: where interfaces meet in sharp
/// edges, or labels are one voxel thin, angle and distance bounds would otherwise refine down to elements whose size
/// then limits the time step of the whole model. (CGAL 6 calls this facet_min_size.)
template <class Tr>
class FacetCriteria : public CGAL::Mesh_facet_criteria_3<Tr> {
    using Base = CGAL::Mesh_facet_criteria_3<Tr>;

public:
    template <class Size>
    FacetCriteria(double angle, const Size& size, double distance, double smallest)
        : Base(angle, size, distance, CGAL::FACET_VERTICES_ON_SURFACE), smallest_squared_(smallest * smallest) {}

    typename Base::Is_facet_bad operator()(const Tr& triangulation, const typename Tr::Facet& facet) const {
        const auto& [cell, corner] = facet;
        bool on_surface = true;
        for (int k = 1; k < 4; ++k) on_surface = on_surface && cell->vertex((corner + k) & 3)->in_dimension() < 3;
        const double squared_radius = CGAL::squared_distance(triangulation.point(cell, (corner + 1) & 3).point(),
                                                             cell->get_facet_surface_center(corner));
        if (on_surface && squared_radius < smallest_squared_) return {};
        return Base::operator()(triangulation, facet);
    }

private:
    double smallest_squared_;
};

template <class Tr>
using Criteria = CGAL::Mesh_criteria_3<Tr, CGAL::Mesh_edge_criteria_3<Tr>, FacetCriteria<Tr>>;

/// Bound on circumradii over target edge: measured on heads and balls, this makes the median edge the target.
constexpr double radius_over_edge = 0.77;

/// Facets whose surface ball is below this part of the target edge are left alone.
constexpr double smallest_facet = 0.3;

/// Bound on the circumradius of facets and cells: that of their label, the finer one on an interface.
struct SizeField {
    using FT = Kernel::FT;
    using Index = Domain::Index;

    const Domain* domain;
    const std::vector<double>* edge_length;

    FT operator()(const Point&, int dimension, const Index& index) const {
        if (dimension == 3) return radius(domain->subdomain_index(index));
        const auto [a, b] = domain->surface_patch_index(index);
        return std::min(radius(a), radius(b));
    }
    [[nodiscard]] double radius(int label) const {
        return radius_over_edge * (*edge_length)[static_cast<std::size_t>(label)];
    }
};

/// Asks the observer from within the label function, the one piece of ours that CGAL calls all the time and from all of
/// its threads, but only in the thread that called the mesher. One thread stops by the exception; several would spin
/// for ever after one, so that they see a flag: at once while refining, at the end of the pass while perturbing.
template <class Concurrency>
class CancelPoll {
public:
    explicit CancelPoll(Observer& observer) : observer_(observer), caller_(std::this_thread::get_id()) {}

    void operator()() {
        thread_local int calls = 0;
        if (++calls < calls_between_polls) return;
        calls = 0;
        if (stop || std::this_thread::get_id() != caller_ || !observer_.cancel_requested()) return;
        stop = true;
        if constexpr (std::is_same_v<Concurrency, CGAL::Sequential_tag>) throw Cancelled();
    }
    void require_going_on() const {
        if (stop) throw Cancelled();
    }

    std::atomic<bool> stop = false;

private:
    static constexpr int calls_between_polls = 1 << 14;  // a few milliseconds

    Observer& observer_;
    std::thread::id caller_;
};

template <class Poll>
Domain make_domain(const RefinementInput& input, Poll& poll) {
    const auto label = [&input, &poll](const Point& p) {
        poll();
        return input.field(Eigen::Array3d(p.x(), p.y(), p.z()));
    };
    const Eigen::Array3d extent =
        input.grid.spacing * Eigen::Array3d(input.grid.size[0] - 1, input.grid.size[1] - 1, input.grid.size[2] - 1);
    const double accuracy = 0.02 * input.grid.spacing.minCoeff();  // mm, of points on interfaces
    return {label, CGAL::Bbox_3(0, 0, 0, extent[0], extent[1], extent[2]),
            CGAL::parameters::relative_error_bound = accuracy / extent.matrix().norm()};
}

template <class C3t3>
void insert_seeds(const RefinementInput& input, const Domain& domain, C3t3& complex) {
    using Tr = typename C3t3::Triangulation;
    const auto intersection = domain.construct_intersection_object();
    const auto point = [](const Eigen::Array3d& p) { return Point(p[0], p[1], p[2]); };
    for (const SurfaceSeed& seed : input.seeds) {
        const auto [place, index, dimension] = intersection(Kernel::Segment_3(point(seed.inside), point(seed.outside)));
        if (dimension == 0) continue;
        const auto vertex = complex.triangulation().insert(typename Tr::Weighted_point(place));
        if (vertex == typename Tr::Vertex_handle()) continue;
        complex.set_dimension(vertex, 2);
        complex.set_index(vertex, index);
    }
}

template <class C3t3>
TetMesh extract(const C3t3& complex) {
    TetMesh mesh;
    const auto count = static_cast<Eigen::Index>(complex.number_of_cells_in_complex());
    mesh.tets.resize(4, count);
    mesh.labels.resize(count);
    std::unordered_map<const void*, int> index;
    std::vector<Point> points;
    Eigen::Index next = 0;
    for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end(); ++cell, ++next) {
        mesh.labels[next] = complex.subdomain_index(cell);
        for (int c = 0; c < 4; ++c) {
            const auto vertex = cell->vertex(c);
            const auto [entry, added] = index.try_emplace(&*vertex, static_cast<int>(points.size()));
            if (added) points.push_back(vertex->point().point());
            mesh.tets(c, next) = entry->second;
        }
    }
    mesh.nodes.resize(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t n = 0; n < points.size(); ++n)
        mesh.nodes.col(static_cast<Eigen::Index>(n)) << points[n].x(), points[n].y(), points[n].z();
    return mesh;
}

template <class Concurrency>
TetMesh refine_with(const RefinementInput& input, Observer& observer) {
    using Tr = Triangulation<Concurrency>;
    namespace p = CGAL::parameters;
    const MeshingOptions& options = input.options;
    CancelPoll<Concurrency> poll(observer);
    const Domain domain = make_domain(input, poll);
    const SizeField size{&domain, &input.edge_length};
    const double shortest = *std::min_element(input.edge_length.begin() + 1, input.edge_length.end());
    const FacetCriteria<Tr> facets(options.facet_angle, size, input.facet_distance, smallest_facet * shortest);
    const Criteria<Tr> criteria(facets, typename Criteria<Tr>::Cell_criteria(options.radius_edge_ratio, size));
    CGAL::set_warning_handler([](const char*, const char*, const char*, int, const char*) {});  // labels too thin
    Complex<Concurrency> complex;
    insert_seeds(input, domain, complex);
    observer.checkpoint("refining the mesh", 0.1);
    CGAL::refine_mesh_3(complex, domain, criteria, p::no_exude(), p::no_perturb(), p::no_odt(), p::no_lloyd(),
                        p::no_reset_c3t3(), p::mesh_3_options(p::pointer_to_stop_atomic_boolean = &poll.stop));
    poll.require_going_on();
    observer.checkpoint("perturbing slivers", 0.6);
    if (options.perturb_seconds > 0.0)
        CGAL::perturb_mesh_3(complex, domain, p::time_limit = options.perturb_seconds,
                             p::sliver_bound = options.min_dihedral_deg);
    poll.require_going_on();
    observer.checkpoint("exuding slivers", 0.8);
    if (options.exude_seconds > 0.0)
        CGAL::exude_mesh_3(complex, p::time_limit = options.exude_seconds, p::sliver_bound = options.min_dihedral_deg);
    return extract(complex);
}

}  // namespace tissuewarp::meshing::detail
