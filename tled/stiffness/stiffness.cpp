#include "tled/stiffness/stiffness.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <oneapi/tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "core/errors.hpp"
#include "tled/model/kinematics.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

using Matrix34 = Eigen::Matrix<double, 3, 4>;

// The block of corners a, b is V Σ_jl ∂P_ij/∂F_kl ∂N_a/∂X_j ∂N_b/∂X_l.
struct ElementTerms {
    Eigen::Matrix<double, 9, 9> tangent;  // times V_e
    Matrix34 gradient;                    // ∇N, a column per corner
    Matrix34 cofactor_gradient;           // cof F ∇N

    [[nodiscard]] Matrix3d block(int row, int column) const {
        Eigen::Matrix<double, 9, 3> half = gradient(0, column) * tangent.leftCols<3>();
        for (int l = 1; l < 3; ++l) half += gradient(l, column) * tangent.middleCols<3>(3 * l);
        Matrix3d result = gradient(0, row) * half.topRows<3>();
        for (int j = 1; j < 3; ++j) result += gradient(j, row) * half.middleRows<3>(3 * j);
        return result;
    }
};

// Turns counts at [i + 1] into offsets.
void accumulate_counts(std::vector<int>& offset) {
    std::int64_t sum = 0;
    for (int& entry : offset) {
        sum += entry;
        if (sum > std::numeric_limits<int>::max()) {
            throw InvalidInput("the stiffness has more than 2147483647 blocks: use a coarser mesh");
        }
        entry = static_cast<int>(sum);
    }
}

// Columns of a row gathered without order or repetition, then sorted; `slot` finds the place of a column.
struct RowGatherer {
    std::vector<int> slot, columns;

    explicit RowGatherer(int size) : slot(size, -1) {}
    void insert(int column) {
        if (slot[column] >= 0) return;
        slot[column] = 0;
        columns.push_back(column);
    }
    void sort() {
        std::sort(columns.begin(), columns.end());
        for (std::size_t k = 0; k < columns.size(); ++k) slot[columns[k]] = static_cast<int>(k);
    }
    void clear() {
        for (int column : columns) slot[column] = -1;
        columns.clear();
    }
};

using Gatherers = tbb::enumerable_thread_specific<RowGatherer>;

// Sparsity of rows × columns: gather(row, gatherer) inserts the columns of a row.
template <typename Gather>
void build_pattern(int rows, int columns, const Gather& gather, std::vector<int>& offset, std::vector<int>& column) {
    Gatherers gatherers([&] { return RowGatherer(columns); });
    offset.assign(rows + 1, 0);
    parallel_for(0, rows, [&](int row) {
        RowGatherer& gatherer = gatherers.local();
        gather(row, gatherer);
        offset[row + 1] = static_cast<int>(gatherer.columns.size());
        gatherer.clear();
    });
    accumulate_counts(offset);
    column.resize(offset[rows]);
    parallel_for(0, rows, [&](int row) {
        RowGatherer& gatherer = gatherers.local();
        gather(row, gatherer);
        std::sort(gatherer.columns.begin(), gatherer.columns.end());
        std::copy(gatherer.columns.begin(), gatherer.columns.end(), column.begin() + offset[row]);
        gatherer.clear();
    });
}

// Calls visit(element, corner) for the elements at a node.
template <typename Visit>
void for_each_at(const Incidence& incidence, int node, const Visit& visit) {
    for (int k = incidence.offset[node]; k < incidence.offset[node + 1]; ++k) {
        visit(incidence.entry[k] / 4, incidence.entry[k] % 4);
    }
}

BlockRows element_rows(const RestState& rest, const std::vector<ElementTerms>& terms) {
    BlockRows result;
    const auto gather = [&](int node, RowGatherer& gatherer) {
        for_each_at(rest.incidence, node, [&](int e, int) {
            for (int neighbour : rest.nodes.col(e)) gatherer.insert(neighbour);
        });
    };
    build_pattern(rest.node_count, rest.node_count, gather, result.offset, result.column);

    result.block.assign(result.column.size(), Matrix3d::Zero());
    parallel_for(0, rest.node_count, [&](int node) {
        const auto begin = result.column.begin() + result.offset[node],
                   end = result.column.begin() + result.offset[node + 1];
        for_each_at(rest.incidence, node, [&](int e, int corner) {
            for (int other = 0; other < 4; ++other) {
                const auto place = std::lower_bound(begin, end, rest.nodes(other, e));
                result.block[place - result.column.begin()] += terms[e].block(corner, other);
            }
        });
    });
    return result;
}

RankOneRows pressure_rows(const RestState& rest, const std::vector<ElementTerms>& terms,
                          const std::vector<VolumetricFunction>& nodal) {
    RankOneRows result;
    const PressureNodes& pressure = rest.pressure;
    const Incidence& incidence = pressure.incidence;
    const auto gather = [&](int a, RowGatherer& gatherer) {
        for (int k = incidence.offset[a]; k < incidence.offset[a + 1]; ++k) {
            for (int node : rest.nodes.col(incidence.entry[k] / 4)) gatherer.insert(node);
        }
    };
    build_pattern(pressure.count(), rest.node_count, gather, result.offset, result.node);

    result.stiffness.resize(pressure.count());
    result.gradient.assign(result.node.size(), Vector3d::Zero());
    parallel_for(0, pressure.count(), [&](int a) {
        result.stiffness[a] = pressure.volume[a] * nodal[a].second;
        const auto begin = result.node.begin() + result.offset[a], end = result.node.begin() + result.offset[a + 1];
        for (int k = incidence.offset[a]; k < incidence.offset[a + 1]; ++k) {
            const int e = incidence.entry[k] / 4;
            const double weight = 0.25 * rest.volume[e] / pressure.volume[a];
            for (int corner = 0; corner < 4; ++corner) {
                const auto place = std::lower_bound(begin, end, rest.nodes(corner, e));
                result.gradient[place - result.node.begin()] += weight * terms[e].cofactor_gradient.col(corner);
            }
        }
    });
    list_by_node(rest.node_count, result);
    return result;
}

}  // namespace

void list_by_node(int node_count, RankOneRows& rows) {
    rows.row.resize(rows.node.size());
    rows.node_offset.assign(node_count + 1, 0);
    for (int a = 0; a < rows.rows(); ++a) {
        for (int k = rows.offset[a]; k < rows.offset[a + 1]; ++k) {
            rows.row[k] = a;
            ++rows.node_offset[rows.node[k] + 1];
        }
    }
    accumulate_counts(rows.node_offset);
    std::vector<int> next = rows.node_offset;
    rows.node_entry.resize(rows.node.size());
    for (std::size_t k = 0; k < rows.node.size(); ++k) rows.node_entry[next[rows.node[k]]++] = static_cast<int>(k);
}

Matrix3d& BlockRows::diagonal(int i) {
    const auto place = std::lower_bound(column.begin() + offset[i], column.begin() + offset[i + 1], i);
    return block[place - column.begin()];
}

const Matrix3d& BlockRows::diagonal(int i) const {
    return const_cast<BlockRows*>(this)->diagonal(i);
}

namespace {

using Matrix9 = Eigen::Matrix<double, 9, 9>;

void keep(Matrix9&) {}

/// Its negative eigenvalues become zero.
void make_positive(Matrix9& symmetric) {
    const Eigen::SelfAdjointEigenSolver<Matrix9> modes(symmetric);
    if (modes.eigenvalues()[0] >= 0) return;
    symmetric =
        modes.eigenvectors() * modes.eigenvalues().cwiseMax(0.0).asDiagonal() * modes.eigenvectors().transpose();
}

template <class Treat>
Stiffness stiffness_of(const RestState& rest, const Matrix3Xd& displacement, const Treat& treat) {
    const VectorXd jacobian = element_jacobians(rest, displacement);
    require_positive(rest, jacobian);
    const std::vector<VolumetricFunction> nodal = nodal_volumetric(rest, jacobian);
    const std::vector<int> material_of = material_of_elements(rest);

    std::vector<ElementTerms> terms(rest.element_count());
    parallel_for(0, rest.element_count(), [&](int e) {
        const Material material = element_material(rest, material_of[e], e);
        Tangent tangent = shear_tangent(material, deformation_gradient(rest, displacement, e));
        add_volumetric_tangent(tangent, element_pressure(rest, e, material, jacobian[e], nodal),
                               rest.volumetric_modulus[e] * volumetric_function(material, jacobian[e]).second);
        treat(tangent.derivative);
        const Matrix34 gradient = shape_gradients(rest, e);
        terms[e] = {rest.volume[e] * tangent.derivative, gradient, cofactor(tangent.F) * gradient};
    });

    Stiffness result;
    result.elements = element_rows(rest, terms);
    result.products = pressure_rows(rest, terms, nodal);
    return result;
}

}  // namespace

Stiffness stiffness(const RestState& rest, const Matrix3Xd& displacement) {
    return stiffness_of(rest, displacement, keep);
}

Stiffness positive_stiffness(const RestState& rest, const Matrix3Xd& displacement) {
    Stiffness positive = stiffness_of(rest, displacement, make_positive);
    positive.products.stiffness = positive.products.stiffness.cwiseMax(0.0);
    return positive;
}

namespace {

/// The same rows by the same threads from product to product, in whose caches they stay.
template <class Body>
void for_rows(int count, const Body& body) {
    parallel_ranges(0, static_cast<std::size_t>(count), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t row = begin; row < end; ++row) body(static_cast<int>(row));
    });
}

}  // namespace

Matrix3Xd Stiffness::multiply(const Matrix3Xd& x) const {
    VectorXd rate(products.rows());  // stiffness_a ∇J_a·x
    for_rows(products.rows(), [&](int a) {
        double sum = 0.0;
        for (int k = products.offset[a]; k < products.offset[a + 1]; ++k) {
            sum += products.gradient[k].dot(x.col(products.node[k]));
        }
        rate[a] = products.stiffness[a] * sum;
    });
    Matrix3Xd y(3, elements.rows());
    for_rows(elements.rows(), [&](int i) {
        Vector3d sum = Vector3d::Zero();
        for (int k = elements.offset[i]; k < elements.offset[i + 1]; ++k) {
            sum += elements.block[k] * x.col(elements.column[k]);
        }
        for (int k = products.node_offset[i]; k < products.node_offset[i + 1]; ++k) {
            const int entry = products.node_entry[k];
            sum += rate[products.row[entry]] * products.gradient[entry];
        }
        y.col(i) = sum;
    });
    return y;
}

std::vector<Matrix3d> Stiffness::diagonal_blocks() const {
    std::vector<Matrix3d> result(elements.rows());
    parallel_for(0, elements.rows(), [&](int i) {
        result[i] = elements.diagonal(i);
        for (int k = products.node_offset[i]; k < products.node_offset[i + 1]; ++k) {
            const int entry = products.node_entry[k];
            const Vector3d& gradient = products.gradient[entry];
            result[i] += products.stiffness[products.row[entry]] * gradient * gradient.transpose();
        }
    });
    return result;
}

BlockRows assembled(const Stiffness& stiffness, Triangle triangle) {
    const BlockRows& elements = stiffness.elements;
    const RankOneRows& products = stiffness.products;
    const auto gather = [&](int i, RowGatherer& gatherer) {
        const int first = triangle == Triangle::Lower ? i : 0;
        const auto insert = [&](int j) {
            if (j >= first) gatherer.insert(j);
        };
        for (int k = elements.offset[i]; k < elements.offset[i + 1]; ++k) insert(elements.column[k]);
        for (int k = products.node_offset[i]; k < products.node_offset[i + 1]; ++k) {
            const int a = products.row[products.node_entry[k]];
            for (int m = products.offset[a]; m < products.offset[a + 1]; ++m) insert(products.node[m]);
        }
    };
    BlockRows result;
    build_pattern(elements.rows(), elements.rows(), gather, result.offset, result.column);

    result.block.assign(result.column.size(), Matrix3d::Zero());
    Gatherers gatherers([&] { return RowGatherer(elements.rows()); });
    parallel_for(0, elements.rows(), [&](int i) {
        RowGatherer& gatherer = gatherers.local();
        for (int k = result.offset[i]; k < result.offset[i + 1]; ++k) gatherer.insert(result.column[k]);
        gatherer.sort();
        Matrix3d* blocks = &result.block[result.offset[i]];
        for (int k = elements.offset[i]; k < elements.offset[i + 1]; ++k) {
            const int slot = gatherer.slot[elements.column[k]];
            if (slot >= 0) blocks[slot] += elements.block[k];
        }
        for (int k = products.node_offset[i]; k < products.node_offset[i + 1]; ++k) {
            const int entry = products.node_entry[k], a = products.row[entry];
            const Vector3d own = products.stiffness[a] * products.gradient[entry];
            for (int m = products.offset[a]; m < products.offset[a + 1]; ++m) {
                const int slot = gatherer.slot[products.node[m]];
                if (slot >= 0) blocks[slot] += own * products.gradient[m].transpose();
            }
        }
        gatherer.clear();
    });
    return result;
}

Eigen::SparseMatrix<double> scalar_matrix(const BlockRows& matrix, const std::vector<int>& index, Triangle triangle) {
    // The blocks are symmetric as a whole, so row i of blocks is read as column i. Within a column the rows ascend with
    // the degree of freedom because `index` does.
    const auto visit = [&](int column, const auto& visitor) {
        const int i = column / 3;
        for (int k = matrix.offset[i]; k < matrix.offset[i + 1]; ++k) {
            for (int c = 0; c < 3; ++c) {
                const int row = 3 * matrix.column[k] + c;
                if (index[row] < 0 || (triangle == Triangle::Lower && row < column)) continue;
                visitor(index[row], matrix.block[k](column % 3, c));
            }
        }
    };
    const int size = static_cast<int>(std::count_if(index.begin(), index.end(), [](int i) { return i >= 0; }));
    Eigen::SparseMatrix<double> result(size, size);
    std::vector<int> offset(size + 1, 0);
    const int columns = static_cast<int>(index.size());
    parallel_for(0, columns, [&](int column) {
        if (index[column] < 0) return;
        visit(column, [&](int, double) { ++offset[index[column] + 1]; });
    });
    accumulate_counts(offset);
    result.resizeNonZeros(offset[size]);
    std::copy(offset.begin(), offset.end(), result.outerIndexPtr());
    parallel_for(0, columns, [&](int column) {
        if (index[column] < 0) return;
        int place = offset[index[column]];
        visit(column, [&](int row, double value) {
            result.innerIndexPtr()[place] = row;
            result.valuePtr()[place++] = value;
        });
    });
    return result;
}

}  // namespace tissuewarp::tled::detail
