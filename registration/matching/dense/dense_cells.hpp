#pragma once
/// From sums over the voxels of cells to forces.

#include "registration/matching/dense/dense_force.hpp"
#include "registration/matching/dense/descriptor_products.hpp"

#include <array>

namespace tissuewarp::registration::detail {

/// What a dense force says (docs/method.md, 11). Chosen together with the grids of ImageOptions::dense_coarsening and
/// the window among some 35 settings on the brain shift, both brain sags and the lung; the degraded brain shift and the
/// liver were not looked at (docs/lab/results.md, "A bare volume of the operation").
struct DenseForceRules {
    static constexpr double independent_share = 0.2;  ///< of the voxels: descriptors and what they miss agree with
                                                      ///< those beside them
    static constexpr double least_square = 1.0;       ///< of a channel's residual, steps of its eight bits
    static constexpr double least_deviation = 0.05;   ///< voxels
    static constexpr double leakage = 0.05;           ///< of the strongest axis: what a plane edge seems to show along
                                                      ///< itself
    static constexpr double most_shift = 1.5;         ///< voxels
    /// Of a cell and those one and two away along each axis: a deviation of one cell.
    static constexpr std::array<double, 3> window{6.0 / 16, 4.0 / 16, 1.0 / 16};
};

/// Cells of a grid: the voxels that have neighbours on all sides, by cubes.
class CellGrid {
public:
    static constexpr int side = 4;  ///< voxels; chosen with DenseForceRules

    explicit CellGrid(const imaging::Geometry& grid);

    /// Centres of the cells.
    [[nodiscard]] const imaging::Geometry& centres() const { return centres_; }
    [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(centres_.voxel_count()); }
    [[nodiscard]] std::ptrdiff_t stride(std::size_t axis) const { return stride_[axis]; }
    [[nodiscard]] Voxel cell(std::size_t n) const;
    /// Of the grid, that a cell begins with.
    [[nodiscard]] Voxel first_voxel(std::size_t n) const;

private:
    imaging::Geometry centres_;
    std::array<std::ptrdiff_t, 3> stride_{};
};

/// With s = (D₁, 1), what a change of contrast would look like: sums over voxels and channels.
struct ContrastSums {
    Eigen::Matrix<double, 3, 2> of_gradients = Eigen::Matrix<double, 3, 2>::Zero();  ///< Σ ½ (∇D₁ + ∇D₂) sᵀ
    Eigen::Vector2d of_residuals = Eigen::Vector2d::Zero();                          ///< Σ (D₁ − D₂) s
    double squares = 0;                                                              ///< Σ D₁²
    double sum = 0;                                                                  ///< Σ D₁
};

/// Sums over voxels, in voxels and steps of the descriptors' eight bits.
struct CellSums {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();  ///< A
    Eigen::Vector3d right = Eigen::Vector3d::Zero();   ///< b
    double squares = 0;                                ///< Σ (D₁ − D₂)²
    double structure = 0;                              ///< Σ ½ (|∇D₁|² + |∇D₂|²)
    double voxels = 0;
    ContrastSums contrast;
    Eigen::Vector3d index = Eigen::Vector3d::Zero();  ///< Σ x
};

/// `index` is the sum of the voxels' own.
CellSums cell_sums(const DescriptorProducts& products, double voxels, const Eigen::Vector3d& index);

/// What of sums is spread: A (00, 11, 22, 01, 02, 12), b, squares, voxels and those of contrast.
using Spread = Eigen::Array<double, 21, 1>;

/// Of forces_of(), kept from one call to the next: fresh memory costs more than what is computed in it.
struct WindowMemory {
    std::vector<Spread> from, to;
};

/// The forces of cells, in the order of `cells`, from the sums of each one's own voxels, which are spread over their
/// neighbours first. Formulas: docs/method.md, section 11.
DenseForces forces_of(const std::vector<CellSums>& own, const CellGrid& cells, const imaging::Geometry& grid,
                      WindowMemory& memory);

}  // namespace tissuewarp::registration::detail
