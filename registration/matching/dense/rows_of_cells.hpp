#pragma once
/// Forces of cells listed in the order of the cells, in all threads.

#include "registration/matching/dense/dense_cells.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>

namespace tissuewarp::registration::detail {

/// Of a cell: voxels that count, and over them Σ tr A and Σ structure (CellSums), in any one unit.
struct CellCount {
    double voxels = 0, common = 0, structure = 0;
};

/// Cells with voxels that count, row by row along i.
template <class CountOf>
class RowsOfCells {
public:
    /// count_of(cell) → CellCount, from any thread.
    RowsOfCells(const CellGrid& cells, const CountOf& count_of)
        : count_of_(count_of), length_(static_cast<std::size_t>(cells.stride(1))), rows_(cells.count() / length_) {
        tbb::parallel_for(std::size_t{0}, rows_.size(), [&](std::size_t row) {
            Row& sum = rows_[row];
            for (std::size_t n = row * length_; n < (row + 1) * length_; ++n) {
                const CellCount count = count_of_(n);
                if (count.voxels < 1) continue;
                ++sum.counted;
                sum.common += count.common;
                sum.structure += count.structure;
            }
        });
        for (Row& row : rows_) {
            row.first = counted_;
            counted_ += row.counted;
        }
    }

    [[nodiscard]] std::size_t counted() const { return counted_; }

    [[nodiscard]] double agreement() const {
        double common = 0, structure = 0;
        for (const Row& row : rows_) {
            common += row.common;
            structure += row.structure;
        }
        return structure > 0 ? common / structure : 0;
    }

    /// visit(cell, its place among those that count), from any thread.
    template <class Visit>
    void for_each_counted(const Visit& visit) const {
        tbb::parallel_for(std::size_t{0}, rows_.size(), [&](std::size_t row) {
            std::size_t place = rows_[row].first;
            for (std::size_t n = row * length_; n < (row + 1) * length_; ++n)
                if (count_of_(n).voxels >= 1) visit(n, place++);
        });
    }

    /// Those without a force leave the list, which is that of all that count.
    void drop_silent(DenseForces& forces) const {
        std::vector<char> silent(counted_);
        for_each_counted([&](std::size_t n, std::size_t place) { silent[place] = !forces.said[n]; });
        if (std::find(silent.begin(), silent.end(), char{1}) == silent.end()) return;
        std::size_t place = 0;
        std::erase_if(forces.forces, [&](const DenseForce&) { return silent[place++] != 0; });
    }

private:
    struct Row {
        std::size_t counted = 0, first = 0;
        double common = 0, structure = 0;
    };

    CountOf count_of_;
    std::size_t length_;
    std::vector<Row> rows_;
    std::size_t counted_ = 0;
};

/// count_of(cell) → CellCount; force_of(cell) → std::optional<DenseForce>, asked for where voxels count; from any
/// thread.
template <class CountOf, class ForceOf>
DenseForces listed_forces(const CellGrid& cells, const CountOf& count_of, const ForceOf& force_of) {
    const RowsOfCells<CountOf> rows(cells, count_of);
    DenseForces result{std::vector<DenseForce>(rows.counted()), cells.centres(),
                       std::vector<std::uint8_t>(cells.count()), rows.agreement()};
    rows.for_each_counted([&](std::size_t n, std::size_t place) {
        const std::optional<DenseForce> force = force_of(n);
        if (!force) return;
        result.forces[place] = *force;
        result.said[n] = 1;
    });
    rows.drop_silent(result);
    return result;
}

}  // namespace tissuewarp::registration::detail
