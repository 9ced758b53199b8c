#pragma once
/// One update on behalf of a request: from what was seen to what is sent.

#include "registration/uncertainty.hpp"
#include "server/patient.hpp"
#include "server/request.hpp"

#include <optional>

namespace tissuewarp::server {

/// An update as it was asked for: everything that its result depends on.
struct Job {
    long long number = 0;      ///< of the update, counted by the server
    std::uint32_t client = 0;  ///< who asked; 0: nobody who is still there
    bool follows = false;      ///< began by itself when data came
    long long state = 0;       ///< of the scene that it sees
    Request request;
    std::string request_text;  ///< as it came
    registration::Intraoperative seen;
    NamedPoints targets;
    std::optional<imaging::Geometry> grid;  ///< for images; none: the moving one, as it is placed
};

struct Products {
    Request request;  ///< what they answer
    registration::UpdateResult result;
    std::optional<registration::Uncertainty> uncertainty;
    PolyData organ;
    NamedPoints targets;            ///< where they are now; their group says how sure that is
    imaging::Volume warped, field;  ///< where they were asked for
    std::string digest;             ///< of displacement and placement: the same bits, the same digest
    double seconds = 0;
    double time_s = 0;  ///< when they were ready, seconds of the years since 1970: the time of their messages
    /// Some doubt says that the result looks as results look that failed.
    [[nodiscard]] bool doubted() const { return registration::count_of_severe(result.doubts) > 0; }
};

/// The surface of the organ as it is now, LPS mm, with its errors at every point.
PolyData organ_of(const Products& products);
/// Where targets (LPS mm, moving frame) are now; the group of each says how sure that is.
NamedPoints targets_of(const Products& products, const NamedPoints& targets, double fade_mm);

/// Computes jobs one after the other; what updates share is made once.
class Computer {
public:
    explicit Computer(ServedPatient patient) : patient_(std::move(patient)) {}
    /// Goes on from what the last update gave, where there is one and the request has its options; then the same last
    /// one gives the same bits. A result that is doubted where the last was not is made again from its beginning.
    /// Throws what Updater::go_on throws.
    Products compute(const Job& job, const Products* last, Observer& observer);

private:
    void use_options(const Request& request, Observer& observer);
    /// With the estimate of its errors, where it is asked for, and its doubts.
    void estimate_errors(Products& products, Observer& observer) const;
    /// The warped image and the field, where they are asked for.
    void make_images(Products& products, const Job& job, Observer& observer) const;

    ServedPatient patient_;
    std::optional<Request> made_for_;  // the options of the updater
    std::optional<registration::Updater> updater_;
};

}  // namespace tissuewarp::server
