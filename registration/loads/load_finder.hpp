#pragma once
/// The unknown loads of one model, kept ready from one update to the next.

#include "registration/loads/load_fit.hpp"
#include "registration/options.hpp"

#include <array>
#include <memory>
#include <optional>
#include <utility>

namespace tissuewarp::registration::detail {

/// What may act on the tissue.
enum class LoadKind {
    Bends,  ///< whatever bends the organ smoothly, as much as organs are expected to (unknown_bends.hpp)
    Weight  ///< body force alone
};

/// Shares of a time budget that must be left where loads are to be looked for.
struct LoadBudget {
    double left_for_bends = 0.5;   ///< chosen by hand; on which data is not recorded
    double left_for_weight = 0.9;  ///< chosen on the brain shift from labels in 3 s, which half overran by 6 %
};
inline constexpr LoadBudget load_budget{};

/// The shapes of one kind.
struct KindOfLoads {
    LoadShapes known;        ///< of the model that they are found on, the coarser one or the model itself
    Eigen::MatrixXd forces;  ///< theirs on the nodes of the model
};

/// How loads were found of data that pull by some springs, to find others of data that pull by similar ones.
struct LoadSearch {
    /// `expected` is the size that is expected beforehand; `followed` as below.
    LoadSearch(std::shared_ptr<const KindOfLoads> of, const SizePrior& expected, const Posterior& with_data,
               bool followed);
    LoadSearch(const LoadSearch&) = delete;
    LoadSearch& operator=(const LoadSearch&) = delete;

    std::shared_ptr<const KindOfLoads> kind;
    SizePrior expected;
    LoadFit fit;
    /// Whether found_beside() leads to loads that data show. Not of bends that were found on a coarser model: it is
    /// stiffer, and where no datum is what the model itself does beyond it would be taken for more loads.
    bool may_be_followed;
};

struct FoundLoads {
    double size = 0;               ///< s of load_fit.hpp
    Eigen::VectorXd coefficients;  ///< and a
    std::shared_ptr<const LoadSearch> search;

    /// On the model's nodes, 3 × N, mN; 3 × 0 where none were found.
    [[nodiscard]] Eigen::Matrix3Xd forces() const;
};

/// Root mean square of the displacements that the two differ by, mm. Of one search.
double difference_mm(const FoundLoads& a, const FoundLoads& b);

/// After a displacement (3 × N, mm, moving frame) under these and what data pull now: those that data show now
/// (LoadFit::work_without), or a part of the step towards them.
FoundLoads found_beside(const FoundLoads& acting, const Eigen::Matrix3Xd& displacement, double step);

class LoadFinder {
public:
    /// The model outlives this.
    LoadFinder(const PreparedModel& prepared, const TissuePrior& tissue) : prepared_(prepared), tissue_(tissue) {}

    /// Whether loads of this kind are to be looked for, with so much of the time budget left. Half of it is kept for
    /// what follows; nine tenths for weight, since the rounds of the large models that labels go with, begun again, are
    /// as long as those before.
    [[nodiscard]] bool worth_while(LoadKind kind, double budget_left) const {
        return tissue_.load_shapes > 0 &&
               budget_left > (kind == LoadKind::Weight ? load_budget.left_for_weight : load_budget.left_for_bends);
    }

    /// The loads of this kind that data pulling like `pulls` tell. Weight is that of a free organ, whatever prior the
    /// pulls hold; otherwise the prior's springs are the same in every call.
    /// Those of a large model are found on its coarser one, which is made where prepare_loads did not. Throws
    /// InvalidInput where the springs do not hold the tissue, Cancelled.
    FoundLoads find(LoadKind kind, const LastPulls& pulls, Observer& observer);

private:
    const PreparedModel& prepared_;
    TissuePrior tissue_;
    std::optional<PreparedModel> twin_;  // where it was not prepared
    std::array<std::shared_ptr<const KindOfLoads>, 2> shapes_;

    [[nodiscard]] const PreparedModel& twin(Observer& observer);
    /// On the model that they are found on, and the same on the model itself.
    [[nodiscard]] std::pair<Eigen::MatrixXd, Eigen::MatrixXd> loads(LoadKind kind, const PreparedModel& model) const;
    [[nodiscard]] std::shared_ptr<const KindOfLoads> shapes(LoadKind kind, const PreparedModel& model,
                                                            const WeighedSprings& unseen);
    [[nodiscard]] FoundLoads found(LoadKind kind, const PreparedModel& model, const LastPulls& pulls);
};

}  // namespace tissuewarp::registration::detail
