#pragma once
/// The wall of a cavity follows what an image shows of it.

#include "registration/boundary/label_boundary_field.hpp"
#include "registration/matching/points/field_of_view.hpp"
#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/boundary_pull.hpp"
#include "registration/terms/term.hpp"

#include <optional>

namespace tissuewarp::registration::detail {

struct CavityTermOptions {
    int first_search = 2;  ///< of the image, from which on its cavity is looked for: the organ lies in place by then
    double range_mm = 12;  ///< along its normal a node of the wall is drawn so far. Chosen by hand; cavities of 10 to
                           ///< 60 ml that collapse to a third lose 4 to 8 mm of radius
};
inline constexpr CavityTermOptions cavity_term_options{};

class CavityTerm : public Term {
public:
    /// Of a model without what is gone. Model, image, view and options outlive this.
    CavityTerm(const PreparedModel& prepared, const imaging::Volume& fixed, const FieldOfView& view,
               const UpdateOptions& options);

    /// Springs from the nodes of the wall along their normals to the wall of the cavity in the image, as labels have
    /// them; none where the image shows no cavity.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;
    void judge(const State& state, UpdateResult& result) override;

private:
    const PreparedModel& prepared_;
    const imaging::Volume& fixed_;
    const FieldOfView& view_;
    const UpdateOptions& options_;
    BoundaryPull pull_;
    int searches_ = 0;                        // of the image, that the cavity was looked for after
    std::optional<LabelBoundaryField> wall_;  // of all that is not the cavity, label 1

    void search(const State& state);
};

}  // namespace tissuewarp::registration::detail
