#pragma once
/// The searches of a model in intraoperative ultrasound.

#include "registration/matching/dense/dense_search.hpp"
#include "registration/matching/ultrasound/echo_engine.hpp"
#include "registration/matching/ultrasound/echo_matches.hpp"
#include "registration/matching/ultrasound/echo_pose.hpp"

namespace tissuewarp::registration::detail {

/// Of one search.
struct EchoLevel {
    double spacing_mm;
    EchoCostOptions costs;
};

/// Chosen on `study coverage --problems ultrasound:1-12` (docs/decisions/ultrasound.md).
struct UltrasoundSearchOptions {
    EchoLevel pose{3, {9, 6, 2}};
    StructureCostOptions structure;  ///< of the pose too, on a grid finer by its step
    double structure_weight = 10;    ///< against the echoes' costs, where poses are told apart; chosen on
                                     ///< `faint-ultrasound:1-24`
    std::vector<EchoLevel> levels{{3, {9, 3, 2}}, {2.5, {8, 2, 2}}, {2, {6, 2, 2}},
                                  {2, {5, 2, 2}}, {2, {5, 2, 2}},   {2, {5, 2, 2}}};
};

class UltrasoundSearch {
public:
    /// Of a moving image of the tissue that is meshed; all outlive this.
    UltrasoundSearch(const meshing::TetMesh& mesh, const imaging::Volume& moving, const SeenImage& fixed,
                     EchoEngine& engine, const UltrasoundSearchOptions& options = {});

    [[nodiscard]] int count() const { return static_cast<int>(options_.levels.size()); }
    /// Where the tissue lies as a whole, from where the headers put it.
    [[nodiscard]] EchoPose pose(const State& by_headers, Observer& observer);
    /// Where tissue belongs, by the search of this number or the last.
    [[nodiscard]] DenseMatches matches(const State& state, int number, const meshing::PointLocator& locator);

    /// Places that the last search looked at.
    [[nodiscard]] int sought() const { return sought_; }

private:
    const meshing::TetMesh& mesh_;
    EchoEngine& engine_;
    UltrasoundSearchOptions options_;
    int sought_ = 0;
    EchoSource source_;

    [[nodiscard]] EchoCosts costs(const State& state, const EchoLevel& level);
};

}  // namespace tissuewarp::registration::detail
