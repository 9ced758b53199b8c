#include "tled/error/hierarchical_product.hpp"

#include "tled/parallel/parallel.hpp"

#include <algorithm>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Eigen::VectorXf;

struct HierarchicalProduct::Batch {
    std::array<Lanes, 45> tangent;                        // lower triangle, row by row
    Local9 volume_rate;                                   // zero where J is not averaged
    std::array<std::array<int, lanes>, 10> place;         // of corners and bubbles in x
    std::array<std::array<int, lanes>, 4> pressure_node;  // of the corners
};

namespace {

constexpr int triangle(int i, int j) {
    return i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i;
}

// D += d ∂L_corner/∂ξ.
template <class Local9, class Lanes>
void add_hat_product(Local9& D, const std::array<Lanes, 3>& d, int corner) {
    for (int i = 0; i < 3; ++i) {
        if (corner > 0) {
            D[3 * (corner - 1) + i] += d[i];
        } else {
            for (int k = 0; k < 3; ++k) D[3 * k + i] -= d[i];
        }
    }
}

// Component i of S ∂L_corner/∂ξ.
template <class Local9>
auto times_hat(const Local9& S, int corner, int i) {
    using Lanes = typename Local9::value_type;
    return corner > 0 ? S[3 * (corner - 1) + i] : Lanes(-(S[i] + S[3 + i] + S[6 + i]));
}

}  // namespace

HierarchicalProduct::~HierarchicalProduct() = default;

HierarchicalProduct::HierarchicalProduct(const HierarchicalTissue& tissue)
    : space_(tissue.space), rest_(tissue.rest), nodal_modulus_(tissue.nodal_modulus) {
    const int count = static_cast<int>(tissue.elements.size());
    batches_.resize((tissue.elements.size() + lanes - 1) / lanes);
    parallel_for(0, static_cast<int>(batches_.size()), [&](int b) {
        Batch& batch = batches_[b];
        for (int lane = 0; lane < lanes; ++lane) {
            const int e = std::min(lanes * b + lane, count - 1);  // lanes beyond the last repeat it with nothing in it
            const float weight = lanes * b + lane < count ? 1.0F : 0.0F;
            const HierarchicalElement& element = tissue.elements[e];
            for (int i = 0; i < 9; ++i) {
                for (int j = 0; j <= i; ++j) {
                    batch.tangent[triangle(i, j)][lane] = weight * static_cast<float>(element.tangent(i, j));
                }
                batch.volume_rate[i][lane] =
                    element.averaged ? weight * static_cast<float>(element.volume_rate[i]) : 0.0F;
            }
            for (int c = 0; c < 4; ++c) {
                batch.place[c][lane] = rest_.nodes(c, e);
                batch.pressure_node[c][lane] = rest_.pressure.of_element(c, e);
            }
            for (int k = 0; k < 6; ++k) batch.place[4 + k][lane] = space_.corner_count + space_.edge_of(k, e);
        }
    });
    any_averaged_ = (nodal_modulus_.array() > 0.0).any();
    forces_.resize(batches_.size());
    place_forces();
}

// Where the forces on a corner or bubble by its elements lie among those of all batches.
void HierarchicalProduct::place_forces() {
    const auto add = [&](const Incidence& incidence, int count, int per_element, int first) {
        for (int row = 0; row < count; ++row) {
            for (int k = incidence.offset[row]; k < incidence.offset[row + 1]; ++k) {
                const int e = incidence.entry[k] / per_element;
                const int component = first + 3 * (incidence.entry[k] % per_element);
                force_place_.push_back((30 * (e / lanes) + component) * lanes + e % lanes);
            }
            force_offset_.push_back(static_cast<int>(force_place_.size()));
        }
    };
    force_offset_.push_back(0);
    add(rest_.incidence, space_.corner_count, 4, 0);
    add(space_.incidence, space_.edge_count(), 6, 12);
}

// With D_a = ∂x/∂ξ at corner a, which is linear between them, the moments are (D_a + Σ D)/20.
std::array<HierarchicalProduct::Local9, 4> HierarchicalProduct::moments(const Batch& batch, const Matrix3Xd& x) {
    std::array<Local9, 4> D;
    for (int lane = 0; lane < lanes; ++lane) {
        const double* origin = &x(0, batch.place[0][lane]);
        for (int k = 0; k < 3; ++k) {
            const double* corner = &x(0, batch.place[k + 1][lane]);
            for (int i = 0; i < 3; ++i) D[0][3 * k + i][lane] = static_cast<float>(corner[i] - origin[i]);
        }
    }
    D[1] = D[2] = D[3] = D[0];
    for (int k = 0; k < 6; ++k) {
        std::array<Lanes, 3> bubble;
        for (int lane = 0; lane < lanes; ++lane) {
            const double* value = &x(0, batch.place[4 + k][lane]);
            for (int i = 0; i < 3; ++i) bubble[i][lane] = 4.0F * static_cast<float>(value[i]);
        }
        const auto [a, b] = tetrahedron_edges[k];
        add_hat_product(D[a], bubble, b);
        add_hat_product(D[b], bubble, a);
    }
    for (int i = 0; i < 9; ++i) {
        const Lanes sum = D[0][i] + D[1][i] + D[2][i] + D[3][i];
        for (Local9& at : D) at[i] = 0.05F * (at[i] + sum);
    }
    return D;
}

VectorXf HierarchicalProduct::pressure_rates(const Matrix3Xd& x) const {
    std::vector<std::array<Lanes, 4>> rate(batches_.size());  // ∫ L_a cof F : ∇x, mm³
    parallel_for(0, static_cast<int>(batches_.size()), [&](int b) {
        const std::array<Local9, 4> moment = moments(batches_[b], x);
        for (int c = 0; c < 4; ++c) {
            rate[b][c] = batches_[b].volume_rate[0] * moment[c][0];
            for (int i = 1; i < 9; ++i) rate[b][c] += batches_[b].volume_rate[i] * moment[c][i];
        }
    });
    VectorXf result(rest_.pressure.count());
    parallel_for(0, rest_.pressure.count(), [&](int a) {
        const Incidence& incidence = rest_.pressure.incidence;
        double sum = 0.0;
        for (int k = incidence.offset[a]; k < incidence.offset[a + 1]; ++k) {
            const int e = incidence.entry[k] / 4;
            sum += static_cast<double>(rate[e / lanes][incidence.entry[k] % 4][e % lanes]);
        }
        result[a] = static_cast<float>(nodal_modulus_[a] * sum);
    });
    return result;
}

Matrix3Xd HierarchicalProduct::operator()(const Matrix3Xd& x) const {
    const VectorXf rates = any_averaged_ ? pressure_rates(x) : VectorXf();
    parallel_for(0, static_cast<int>(batches_.size()), [&](int number) {
        const Batch& batch = batches_[number];
        const std::array<Local9, 4> moment = moments(batch, x);
        std::array<Local9, 4> stress;  // its moments
        for (int c = 0; c < 4; ++c) {
            for (int i = 0; i < 9; ++i) {
                stress[c][i] = batch.tangent[triangle(i, 0)] * moment[c][0];
                for (int j = 1; j < 9; ++j) stress[c][i] += batch.tangent[triangle(i, j)] * moment[c][j];
            }
        }
        if (any_averaged_) {
            std::array<Lanes, 4> pressure;
            for (int c = 0; c < 4; ++c) {
                for (int lane = 0; lane < lanes; ++lane) pressure[c][lane] = rates[batch.pressure_node[c][lane]];
            }
            const Lanes sum = pressure[0] + pressure[1] + pressure[2] + pressure[3];
            for (int c = 0; c < 4; ++c) {
                const Lanes p = 0.05F * (pressure[c] + sum);
                for (int i = 0; i < 9; ++i) stress[c][i] += p * batch.volume_rate[i];
            }
        }
        Local9 whole;
        for (int i = 0; i < 9; ++i) whole[i] = stress[0][i] + stress[1][i] + stress[2][i] + stress[3][i];
        for (int i = 0; i < 3; ++i) {
            for (int c = 0; c < 4; ++c) forces_[number][3 * c + i] = times_hat(whole, c, i);
            for (int k = 0; k < 6; ++k) {
                const auto [a, b] = tetrahedron_edges[k];
                forces_[number][12 + 3 * k + i] = 4.0F * (times_hat(stress[a], b, i) + times_hat(stress[b], a, i));
            }
        }
    });
    Matrix3Xd result(3, space_.size());
    parallel_for(0, space_.size(), [&](int i) {
        Vector3d sum = Vector3d::Zero();
        for (int k = force_offset_[i]; k < force_offset_[i + 1]; ++k) {
            const float* force = forces_.front().front().data() + force_place_[k];
            sum += Vector3d(force[0], force[lanes], force[2 * lanes]);
        }
        result.col(i) = sum;
    });
    return result;
}

}  // namespace tissuewarp::tled::detail
