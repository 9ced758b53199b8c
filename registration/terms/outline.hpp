#pragma once
/// The outer surface of an organ whose images show nothing around it, after a resection: the brain sinks from the skull
/// then, and air that was stripped off takes its place.

#include "registration/boundary/label_boundary_field.hpp"
#include "registration/terms/boundary_pull.hpp"
#include "registration/terms/term.hpp"

#include <memory>
#include <vector>

namespace tissuewarp::registration::detail {

struct OutlineOptions {
    double least_alone =
        0.8;               ///< share of the outer surface's nodes where the moving image ends, from which on it
                           ///< shows the organ alone. Chosen by hand: skulls were stripped off all around or nowhere
    double range_mm = 12;  ///< along its normal a node is drawn so far. Chosen by hand: the brain sinks by 5 to 15 mm
};
inline constexpr OutlineOptions outline_options{};

/// Draws nodes of the outer surface, but not of the wall of a cavity, along their normals to where the fixed image
/// ends, as far from there as they were from where the moving one ended.
class OutlineTerm : public Term {
public:
    /// `before`: per interface node how far ahead the moving image ended, mm, NaN where it did not; `shown`: mask
    /// (uint8) of what the fixed image shows. Model, mask and options outlive this.
    OutlineTerm(const PreparedModel& prepared, std::vector<double> before, const imaging::Volume& shown,
                const UpdateOptions& options);

    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

private:
    imaging::Geometry grid_;
    double max_angle_deg_;
    std::vector<double> before_;
    LabelBoundaryField shown_;  // label 1
    BoundaryPull pull_;
};

/// Of a model that holds an image; null where that shows more than the organ.
std::unique_ptr<Term> outline_term(const PreparedModel& prepared, const imaging::Volume& shown,
                                   const UpdateOptions& options);

}  // namespace tissuewarp::registration::detail
