#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/field/held_bodies.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/field/voxel_jacobian.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <unordered_map>
#include <vector>

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;
using Voxels = std::vector<std::int64_t>;  // in ascending order

constexpr float least_determinant = 0.05F;
constexpr double most_folded_share = 0.05;  // of all voxels: more is no map to mend

/// Voxels that may be smoothed: beside the mesh and what is rigid; all beside it and its outermost; all.
enum class Free { Beside, Rim, All };

/// Who is smoothed, and how much.
struct Pass {
    Free free;
    int reach;  // steps from a folded voxel
    int sweeps, rounds;
};
// What is beside the mesh is free to give way, and most folds go. Those left lie where parts of the mesh pass into each
// other, a gap of a voxel closes, or the organ slid far along bone: there mesh and bone give way, as little as they
// can.
constexpr Pass passes[] = {
    {Free::Beside, 2, 5, 10}, {Free::Rim, 1, 1, 20}, {Free::All, 1, 1, 20}, {Free::All, 3, 1, 20}};

std::array<int, 3> index_of(std::int64_t voxel, const Geometry& grid) {
    const std::int64_t row = voxel / grid.size[0];
    return {int(voxel % grid.size[0]), int(row % grid.size[1]), int(row / grid.size[1])};
}

/// Calls visit(neighbour) for those of the six that the grid holds.
template <class Visit>
void for_each_neighbour(std::int64_t voxel, const Geometry& grid, const Visit& visit) {
    const auto index = index_of(voxel, grid);
    std::int64_t stride = 1;
    for (std::size_t axis = 0; axis < 3; stride *= grid.size[int(axis)], ++axis) {
        if (index[axis] > 0) visit(voxel - stride);
        if (index[axis] + 1 < grid.size[int(axis)]) visit(voxel + stride);
    }
}

Voxels with_neighbours(const Voxels& voxels, const Geometry& grid) {
    Voxels result = voxels;
    for (const std::int64_t voxel : voxels)
        for_each_neighbour(voxel, grid, [&](std::int64_t neighbour) { result.push_back(neighbour); });
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
}

Voxels folded_of_all(const Volume& displacement) {
    const Geometry& grid = displacement.geometry;
    const detail::VoxelJacobian jacobian(displacement);
    std::vector<Voxels> slices(static_cast<std::size_t>(grid.size[2]));
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                if (jacobian.determinant({i, j, k}) <= least_determinant)
                    slices[std::size_t(k)].push_back(displacement.offset(i, j, k));
    });
    Voxels result;
    for (const Voxels& slice : slices) result.insert(result.end(), slice.begin(), slice.end());
    return result;
}

std::int64_t count_turned(const detail::VoxelJacobian& jacobian, const Voxels& voxels, const Geometry& grid) {
    return std::count_if(voxels.begin(), voxels.end(),
                         [&](std::int64_t voxel) { return jacobian.determinant(index_of(voxel, grid)) <= 0; });
}

/// The organ and what is rigid about it, in the frame of a field.
struct Bodies {
    meshing::TetMesh mesh;  // labelled by whether a tetrahedron lies at a surface that slides
    detail::HeldBodies rigid;
    Eigen::Isometry3d to_rigid;  // into the frame of these
};

constexpr int holds_together = 1, slides = 2;  // labels of tetrahedra

/// Which nodes lie at rest where another one does: the mesh is open there.
std::vector<bool> doubled(const Eigen::Matrix3Xd& rest) {
    std::vector<int> order(static_cast<std::size_t>(rest.cols()));
    std::iota(order.begin(), order.end(), 0);
    const auto place = [&](int node) { return std::array{rest(0, node), rest(1, node), rest(2, node)}; };
    std::sort(order.begin(), order.end(), [&](int a, int b) { return place(a) < place(b); });
    std::vector<bool> result(order.size(), false);
    for (std::size_t n = 1; n < order.size(); ++n)
        if (place(order[n - 1]) == place(order[n]))
            result[std::size_t(order[n - 1])] = result[std::size_t(order[n])] = true;
    return result;
}

/// A mesh of these nodes whose labels say which tetrahedra lie at a surface that slides.
meshing::TetMesh labelled_by_sliding(const Deformation& deformation, Eigen::Matrix3Xd nodes) {
    const std::vector<bool> open = doubled(deformation.mesh.nodes);
    meshing::TetMesh mesh{std::move(nodes), deformation.mesh.tets, deformation.mesh.labels};
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const auto corners = mesh.tets.col(t);
        mesh.labels[t] = std::any_of(corners.begin(), corners.end(), [&](int node) { return open[std::size_t(node)]; })
                             ? slides
                             : holds_together;
    }
    return mesh;
}

class Unfolder {
public:
    Unfolder(Volume& displacement, const Bodies& bodies, Voxels folded)
        : grid_(displacement.geometry),
          field_(displacement.data<cv::Vec3f>()),
          jacobian_(displacement),
          organ_(labels_of_mesh(bodies.mesh, grid_)),
          inside_(organ_.data<std::int32_t>()),
          bodies_(bodies),
          folded_(std::move(folded)) {}

    void operator()(const Pass& pass) {
        for (int round = 0; round < pass.rounds && !folded_.empty(); ++round) {
            const Voxels free = free_about_folds(pass);
            for (int sweep = 0; sweep < pass.sweeps; ++sweep) smooth(free);
            find_folds(free);
        }
    }

    [[nodiscard]] Unfolding changes() const {
        Unfolding result{.left = count_turned(jacobian_, folded_, grid_),
                         .organ = cv::countNonZero(organ_.voxels.reshape(1, 1))};
        for (const auto& [voxel, before] : before_) {
            ++result.voxels;
            if (inside_[voxel] == slides) ++result.sliding;
            if (inside_[voxel] != holds_together) continue;
            ++result.in_organ;
            result.most_in_organ_mm = std::max(result.most_in_organ_mm, cv::norm(field_[voxel] - before));
        }
        return result;
    }

private:
    [[nodiscard]] bool on_rim(std::int64_t voxel) const {
        bool rim = false;
        for_each_neighbour(voxel, grid_, [&](std::int64_t other) { rim = rim || !inside_[other]; });
        return rim;
    }
    [[nodiscard]] bool is_free(std::int64_t voxel, const Pass& pass) const {
        if (inside_[voxel]) return pass.free == Free::All || (pass.free == Free::Rim && on_rim(voxel));
        if (pass.free != Free::Beside) return true;
        const auto index = index_of(voxel, grid_);
        return bodies_.rigid.at(bodies_.to_rigid * grid_.point(Eigen::Vector3d(index[0], index[1], index[2]))) == 0;
    }
    [[nodiscard]] Voxels free_about_folds(const Pass& pass) const {
        Voxels near = folded_;
        for (int step = 0; step < pass.reach; ++step) near = with_neighbours(near, grid_);
        std::erase_if(near, [&](std::int64_t voxel) { return !is_free(voxel, pass); });
        return near;
    }
    /// All at once take the mean of their neighbours; in place of one beyond the border counts the voxel itself.
    void smooth(const Voxels& free) {
        std::vector<cv::Vec3f> means;
        for (const std::int64_t voxel : free) {
            cv::Vec3f sum(0, 0, 0);
            int count = 0;
            for_each_neighbour(voxel, grid_, [&](std::int64_t other) {
                sum += field_[other];
                ++count;
            });
            means.push_back((sum + float(6 - count) * field_[voxel]) / 6.0F);
        }
        for (std::size_t n = 0; n < free.size(); ++n) {
            before_.try_emplace(free[n], field_[free[n]]);
            field_[free[n]] = means[n];
        }
    }
    void find_folds(const Voxels& changed) {
        Voxels candidates = with_neighbours(changed, grid_);
        candidates.insert(candidates.end(), folded_.begin(), folded_.end());
        std::sort(candidates.begin(), candidates.end());
        candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
        std::erase_if(candidates, [&](std::int64_t voxel) {
            return jacobian_.determinant(index_of(voxel, grid_)) > least_determinant;
        });
        folded_ = std::move(candidates);
    }

    const Geometry& grid_;
    cv::Vec3f* field_;
    detail::VoxelJacobian jacobian_;
    Volume organ_;
    const std::int32_t* inside_;
    const Bodies& bodies_;
    Voxels folded_;
    std::unordered_map<std::int64_t, cv::Vec3f> before_;
};

template <class MakeBodies>
Unfolding unfold(Volume& field, const MakeBodies& bodies_of_frame) {
    if (field.voxels.type() != CV_32FC3)
        throw InvalidInput("unfolding: the field must have three channels of float32; give a displacement field");
    Voxels folded = folded_of_all(field);
    if (folded.empty()) return {};
    const Geometry& grid = field.geometry;
    if (double(folded.size()) > most_folded_share * double(grid.voxel_count()))
        return {.left = count_turned(detail::VoxelJacobian(field), folded, grid)};
    const Bodies bodies = bodies_of_frame();
    Unfolder unfolder(field, bodies, std::move(folded));
    for (const Pass& pass : passes) unfolder(pass);
    return unfolder.changes();
}

}  // namespace

Unfolding unfold_moving_to_fixed(Volume& field, const Deformation& deformation) {
    return unfold(field, [&] {
        return Bodies{labelled_by_sliding(deformation, deformation.mesh.nodes), detail::held_before(deformation),
                      Eigen::Isometry3d::Identity()};
    });
}

Unfolding unfold_fixed_to_moving(Volume& field, const Deformation& deformation) {
    return unfold(field, [&] {
        return Bodies{labelled_by_sliding(deformation, deformation.deformed_nodes()), detail::held_after(deformation),
                      deformation.far_motion().inverse()};
    });
}

}  // namespace tissuewarp::registration
