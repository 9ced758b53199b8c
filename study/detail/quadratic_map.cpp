#include "study/detail/quadratic_map.hpp"

#include <Eigen/LU>

#include <array>
#include <map>
#include <utility>
#include <vector>

namespace tissuewarp::study::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

/// The unit tetrahedron cut into 64: 35 local points, and which four of them each piece has.
struct Cut {
    std::vector<Vector3d> points;
    std::vector<std::array<int, 4>> pieces{{0, 1, 2, 3}};
};

double volume(const std::vector<Vector3d>& points, const std::array<int, 4>& piece) {
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k)
        edges.col(k) = points[std::size_t(piece[std::size_t(k + 1)])] - points[std::size_t(piece[0])];
    return edges.determinant() / 6;
}

/// Each piece into eight: four at its corners, and the octahedron between them (Bey 1995).
void cut_again(Cut& cut) {
    std::map<std::pair<int, int>, int> middle;
    const auto between = [&](int a, int b) {
        const auto [place, is_new] = middle.emplace(std::minmax(a, b), static_cast<int>(cut.points.size()));
        if (is_new) cut.points.push_back(0.5 * (cut.points[std::size_t(a)] + cut.points[std::size_t(b)]));
        return place->second;
    };
    std::vector<std::array<int, 4>> pieces;
    for (const auto& [a, b, c, d] : cut.pieces) {
        const int ab = between(a, b), ac = between(a, c), ad = between(a, d), bc = between(b, c), bd = between(b, d),
                  cd = between(c, d);
        const std::array<std::array<int, 4>, 8> eight{{{a, ab, ac, ad},
                                                       {ab, b, bc, bd},
                                                       {ac, bc, c, cd},
                                                       {ad, bd, cd, d},
                                                       {ab, ac, ad, bd},
                                                       {ab, bc, ac, bd},
                                                       {ac, bd, ad, cd},
                                                       {ac, bc, bd, cd}}};
        pieces.insert(pieces.end(), eight.begin(), eight.end());
    }
    for (std::array<int, 4>& piece : pieces)
        if (volume(cut.points, piece) < 0) std::swap(piece[2], piece[3]);
    cut.pieces = std::move(pieces);
}

const Cut& fine_cut() {
    static const Cut result = [] {
        Cut cut;
        cut.points = {Vector3d::Zero(), Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
        cut_again(cut);
        cut_again(cut);
        return cut;
    }();
    return result;
}

Eigen::Matrix<double, 3, 10> nodes_of(const tled::QuadraticMesh& mesh, const Matrix3Xd& nodes, int element) {
    Eigen::Matrix<double, 3, 10> result;
    for (int c = 0; c < 10; ++c) result.col(c) = nodes.col(mesh.tets(c, element));
    return result;
}

/// The pieces of one element after the other; they share no nodes.
meshing::TetMesh fine_mesh(const tled::QuadraticMesh& mesh, const Matrix3Xd& nodes) {
    const Cut& cut = fine_cut();
    const auto points = int(cut.points.size()), pieces = int(cut.pieces.size());
    meshing::TetMesh fine;
    fine.nodes.resize(3, Eigen::Index(points) * mesh.tet_count());
    fine.tets.resize(4, Eigen::Index(pieces) * mesh.tet_count());
    fine.labels = Eigen::VectorXi::Ones(fine.tets.cols());
    for (int e = 0; e < mesh.tet_count(); ++e) {
        const auto corners = nodes_of(mesh, nodes, e);
        for (int p = 0; p < points; ++p)
            fine.nodes.col(e * points + p) = corners * tled::quadratic_shape(cut.points[std::size_t(p)]);
        for (int p = 0; p < pieces; ++p)
            for (int c = 0; c < 4; ++c)
                fine.tets(c, e * pieces + p) = e * points + cut.pieces[std::size_t(p)][std::size_t(c)];
    }
    return fine;
}

}  // namespace

FineTetrahedra::FineTetrahedra(const tled::QuadraticMesh& mesh, const Matrix3Xd& nodes)
    : locator_(fine_mesh(mesh, nodes)) {}

std::optional<FineTetrahedra::Place> FineTetrahedra::find(const Vector3d& point) const {
    const auto found = locator_.find(point);
    if (!found) return std::nullopt;
    const Cut& cut = fine_cut();
    const auto pieces = int(cut.pieces.size());
    Place place;
    place.element = found->tet / pieces;
    const auto& piece = cut.pieces[std::size_t(found->tet % pieces)];
    for (int c = 0; c < 4; ++c) place.local += found->barycentric[c] * cut.points[std::size_t(piece[std::size_t(c)])];
    return place;
}

QuadraticMap::QuadraticMap(tled::QuadraticMesh mesh, Matrix3Xd displacement)
    : mesh_(std::move(mesh)), displacement_(std::move(displacement)), places_(mesh_, mesh_.nodes) {}

std::optional<Vector3d> QuadraticMap::operator()(const Vector3d& point) const {
    const auto place = places_.find(point);
    if (!place) return std::nullopt;
    const auto X = nodes_of(mesh_, mesh_.nodes, place->element);
    Vector3d local = place->local;
    for (int iteration = 0; iteration < 4; ++iteration) {  // Newton's method; from an error of (edge/4)² of curvature
        const Vector3d miss = point - X * tled::quadratic_shape(local);
        local += (X * tled::quadratic_shape_derivatives(local)).inverse() * miss;
    }
    return Vector3d(point + nodes_of(mesh_, displacement_, place->element) * tled::quadratic_shape(local));
}

}  // namespace tissuewarp::study::detail
