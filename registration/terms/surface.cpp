#include "registration/terms/surface.hpp"

#include "registration/uncertainty/doubts.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace tissuewarp::registration::detail {

namespace {

constexpr double least_deviation_mm = 0.3;  // the model's own surface is no better

double area_of(const meshing::SurfaceMesh& surface) {
    double area = 0;
    for (const auto& triangle : surface.triangles.colwise()) {
        const Eigen::Vector3d a = surface.nodes.col(triangle[0]), b = surface.nodes.col(triangle[1]),
                              c = surface.nodes.col(triangle[2]);
        area += 0.5 * (b - a).cross(c - a).norm();
    }
    return area;
}

std::array<int, 3> sorted(std::array<int, 3> nodes) {
    std::sort(nodes.begin(), nodes.end());
    return nodes;
}

}  // namespace

SurfaceEvidence::SurfaceEvidence(const PreparedModel& prepared, const SurfacePoints& surface,
                                 const SurfaceOptions& options, double energy)
    : prepared_(prepared), options_(options), data_(surface_data(surface)), energy_(energy) {
    take_surface();
}

/// The outer faces that are a boundary of tissue, not a cut by the image's border, moved out to where the labels end.
void SurfaceEvidence::take_surface() {
    const meshing::TetMesh& mesh = prepared_.model.mesh;
    std::map<int, Eigen::Vector3d> places;
    for (const InterfaceNode& node : prepared_.interfaces.nodes()) {
        if (node.outer != 0 || std::isnan(node.offset)) continue;
        places[node.node] = mesh.nodes.col(node.node) + node.offset * node.normal;
    }
    std::map<int, int> index;
    for (const auto& [node, place] : places) {
        index[node] = static_cast<int>(node_of_.size());
        node_of_.push_back(node);
    }
    std::map<std::array<int, 3>, int> tet_of_face;
    for (int tet = 0; tet < mesh.tet_count(); ++tet)
        for (int left_out = 0; left_out < 4; ++left_out) {
            std::array<int, 3> face{};
            for (int k = 0; k < 3; ++k) face[static_cast<std::size_t>(k)] = mesh.tets((left_out + 1 + k) % 4, tet);
            if (places.contains(face[0]) && places.contains(face[1]) && places.contains(face[2]))
                tet_of_face[sorted(face)] = tet;
        }
    std::vector<Eigen::Vector3i> triangles;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh)) {
        if (face.outer != 0) continue;
        const auto [a, b, c] = face.nodes;
        if (!places.contains(a) || !places.contains(b) || !places.contains(c)) continue;
        triangles.emplace_back(index[a], index[b], index[c]);
        tet_of_.push_back(tet_of_face.at(sorted(face.nodes)));
    }
    if (triangles.empty()) throw InvalidInput("the model has no outer surface that the image shows");
    surface_.nodes.resize(3, static_cast<Eigen::Index>(node_of_.size()));
    for (const auto& [node, place] : places) surface_.nodes.col(index[node]) = place;
    surface_.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
    for (std::size_t t = 0; t < triangles.size(); ++t)
        surface_.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
}

meshing::SurfaceMesh SurfaceEvidence::deformed_surface(const Eigen::Matrix3Xd& displacement) const {
    return {surface_.nodes + displacement(Eigen::all, node_of_), surface_.triangles};
}

double SurfaceEvidence::final_scale_mm() const {
    return options_.outlier_deviations * std::max(data_.deviation_mm, least_deviation_mm);
}

Alignment SurfaceEvidence::align(const AlignmentOptions& options, Observer& observer) {
    pose_ = search_surface_pose(SurfaceTree(surface_), surface_, data_, options, observer);
    return {pose_.placement, pose_.typical_distance_mm()};
}

std::vector<SurfaceEvidence::Match> SurfaceEvidence::matches(const State& state, double reach_mm) const {
    const SurfaceTree tree(deformed_surface(state.displacement));
    const Eigen::Isometry3d back = state.placement.inverse();
    const double least_cosine = std::cos(options_.max_angle_deg * EIGEN_PI / 180);
    std::vector<Match> result(static_cast<std::size_t>(data_.count()));
    tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t n) {
        const auto column = static_cast<Eigen::Index>(n);
        const Eigen::Vector3d point = back * data_.points.col(column);
        const Eigen::Vector3d normal = back.linear() * data_.normals.col(column);
        const auto hit = tree.closest(point, reach_mm, {normal, least_cosine, data_.oriented});
        if (!hit) return;
        const double sign = normal.dot(hit->normal) < 0 ? -1 : 1;
        Match& match = result[n];
        match.found = true;
        match.hit = *hit;
        match.normal = (hit->normal + sign * normal).normalized();
        match.distance_mm = match.normal.dot(point - hit->point);
    });
    return result;
}

/// K = energy/σ² · area/patch² · weight · n nᵀ, at the point of the surface's triangle.
Pull SurfaceEvidence::pull_of(const Match& match, double area, double weight, const State& state,
                              double most_step_mm) const {
    const meshing::TetMesh& mesh = prepared_.model.mesh;
    Pull pull;
    pull.at.tet = tet_of_[static_cast<std::size_t>(match.hit.triangle)];
    for (int corner = 0; corner < 3; ++corner) {
        const int node = node_of_[static_cast<std::size_t>(surface_.triangles(corner, match.hit.triangle))];
        for (int k = 0; k < 4; ++k)
            if (mesh.tets(k, pull.at.tet) == node) pull.at.barycentric[k] = match.hit.barycentric[corner];
    }
    const double deviation = std::max(data_.deviation_mm, least_deviation_mm);
    const double stiffness =
        weight * energy_ / (deviation * deviation) * area / (options_.patch_mm * options_.patch_mm);
    pull.stiffness = stiffness * match.normal * match.normal.transpose();
    pull.target = displacement_at(mesh, state.displacement, pull.at) +
                  std::clamp(match.distance_mm, -most_step_mm, most_step_mm) * match.normal;
    return pull;
}

Contribution SurfaceEvidence::contribution(const RoundPlan& plan, const State& state) {
    constexpr double scale_ratio = 0.6;  // from round to round
    const double reach = std::max(4 * final_scale_mm(), 3 * plan.range_mm);
    const std::vector<Match> found = matches(state, reach);
    if (plan.number == 0) {
        std::vector<double> distances;
        for (const Match& match : found)
            if (match.found) distances.push_back(std::abs(match.distance_mm));
        if (distances.empty())
            throw InvalidInput("no point of the intraoperative surface lies within " + to_text(reach) +
                               " mm of the model; check the frame and the unit of the points");
        const auto high = distances.begin() + static_cast<std::ptrdiff_t>(double(distances.size() - 1) * 0.9);
        std::nth_element(distances.begin(), high, distances.end());
        first_scale_mm_ = 2 * *high;
    }
    const double scale =
        plan.last ? final_scale_mm() : std::max(final_scale_mm(), first_scale_mm_ * std::pow(scale_ratio, plan.number));
    Contribution result;
    std::vector<Pull> pulls;
    double weights = 0;
    for (std::size_t n = 0; n < found.size(); ++n) {
        const Match& match = found[n];
        if (!match.found) continue;
        const double weight = robust_weight(match.distance_mm, scale), area = data_.areas[static_cast<Eigen::Index>(n)];
        pulls.push_back(pull_of(match, area, weight, state, plan.most_step_mm));
        result.held_back += weight > 0.5 && std::abs(match.distance_mm) > plan.most_step_mm;
        result.mean_residual_mm += area * weight * std::abs(match.distance_mm);
        weights += area * weight;
    }
    if (weights > 0) result.mean_residual_mm /= weights;
    result.candidates = static_cast<int>(found.size());
    result.matched = static_cast<int>(pulls.size());
    result.conditions.springs = lumped_springs(prepared_.model.mesh, pulls, state.displacement);
    return result;
}

SurfaceFit SurfaceEvidence::fit(const State& state) const {
    const double limit = final_scale_mm();
    SurfaceFit fit;
    double area = 0, squared = 0;
    int inliers = 0;
    const std::vector<Match> found = matches(state, 4 * limit);
    for (std::size_t n = 0; n < found.size(); ++n) {
        if (!found[n].found || std::abs(found[n].distance_mm) > limit) continue;
        ++inliers;
        area += data_.areas[static_cast<Eigen::Index>(n)];
        squared += found[n].distance_mm * found[n].distance_mm;
    }
    fit.inlier_share = inliers / double(found.size());
    fit.residual_mm = inliers > 0 ? std::sqrt(squared / inliers) : limit;
    fit.coverage = area / area_of(surface_);
    fit.pose_searched = pose_.scale_mm > 0;
    fit.rival_mm = pose_.rival_mm;
    fit.rival_support = pose_.cost < 1 ? (1 - pose_.rival_cost) / (1 - pose_.cost) : 1;
    return fit;
}

}  // namespace tissuewarp::registration::detail
