#pragma once
/// What the study solves again and again: bodies, whose exact displacement is computed, and patients, whose truth is
/// known.

#include "core/observer.hpp"
#include "study/body.hpp"
#include "study/point.hpp"

#include "registration/evaluation.hpp"
#include "registration/intraoperative.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::study {

class Problem {
public:
    virtual ~Problem() = default;
    [[nodiscard]] virtual std::string name() const = 0;   ///< of files: "cube", "phantom:7"
    [[nodiscard]] virtual std::string story() const = 0;  ///< one line for people
    /// What other settings differ from in one thing: the physics is the problem's own.
    [[nodiscard]] virtual Setting base() const = 0;
    /// Whether the answer is scored against truth, in place of a reference.
    [[nodiscard]] virtual bool is_registration() const = 0;
    /// Why the problem cannot be solved so; empty when it can.
    [[nodiscard]] virtual std::string refusal(const Setting& setting) const = 0;
    /// Solves `runs` times. Preparations are kept for the next setting that shares them: put those side by side. A
    /// solver that fails is an answer (Point::failure). Throws InvalidInput, GpuUnavailable, Cancelled.
    virtual Point measure(const Setting& setting, int runs, Observer& observer) = 0;
};

struct BodyOptions {
    int reference_tetrahedra = 3000;  ///< quadratic
    std::filesystem::path cache;      ///< folder where references are kept; empty: nowhere
    int most_checked = 60000;         ///< elements up to which the algebraic error is found by Newton's method
    int gpu_index = -1;               ///< EGL device, −1: the first with hardware
};
std::unique_ptr<Problem> body_problem(Body body, const BodyOptions& options);

/// A preoperative label map, what was seen during the operation, and where targets truly went.
struct Patient {
    std::string name, story;
    imaging::Volume labels;
    registration::Intraoperative seen;
    registration::Landmarks targets;
    bool aligned = false;  ///< both images are in one frame
};
/// The label map of the operation, and the landmarks, of a folder of data/brainshift's layout. Throws IoError.
Patient patient_of(const std::filesystem::path& folder, const std::string& name, const std::string& story);
/// study::random_phantom of that seed, registered to a part of its surface and pairs of points.
Patient random_patient(std::uint64_t seed, Observer& observer);

std::unique_ptr<Problem> patient_problem(Patient patient, int gpu_index = -1);

}  // namespace tissuewarp::study
