#pragma once
/// Time-dependent problems of data/reference, p8: axial vibration of a bar and Prony relaxation, on any engine.

#include "tled/engine.hpp"
#include "tled/model.hpp"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::verification {

using MakeEngine = std::function<std::unique_ptr<tled::Engine>(const tled::RestState&)>;

/// How the bar is held at z = 0: in z alone, or in all directions.
enum class BarEnd { Roller, Clamped };

/// Period (s) of the first axial mode of the bar 20 × 20 × 100 mm, E = 3 kPa, of small amplitude, from the zero
/// crossings of its projection on the mode; a quarter of the bar with `cells` across and ten times as many along it.
double bar_period(double poisson, BarEnd end, tled::Element element, int cells, const MakeEngine& make_engine);

struct BarReference {
    double poisson;
    BarEnd end;
    double period, uncertainty;  // s
};
std::vector<BarReference> bar_references();

/// Force on the face z = L of the viscoelastic cube at the times of the file that are at most `last`.
struct Relaxation {
    std::string name;
    std::vector<double> time{};       ///< s
    std::vector<double> computed{};   ///< mN
    std::vector<double> reference{};  ///< mN
};
/// Simple shear and confined compression stepped at t = 0, simple shear ramped in 0.1 s: whole boundary imposed,
/// backward Euler with steps of `time_step` (s) that divide 0.05 s.
std::vector<Relaxation> imposed_relaxation(double time_step, double last, const MakeEngine& make_engine);
/// Uniaxial stretch 1.2 with free sides, as a damped motion of tissue with a ten-thousandth of its density.
Relaxation uniaxial_relaxation(double last, const MakeEngine& make_engine);

}  // namespace tissuewarp::verification
