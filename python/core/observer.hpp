#pragma once
/// Long calls without Python's lock, that tell a Python function how far they are and stop when it says so.

#include "core/observer.hpp"

#include <pybind11/pybind11.h>

#include <atomic>
#include <chrono>
#include <exception>

namespace tissuewarp::python {

namespace py = pybind11;

/// Progress goes to a function (stage, fraction), notes to the logger "tissuewarp". What the function returns or
/// throws, or an interrupt by the user, ends the call. Any thread may call it; none must hold Python's lock while it
/// waits for another.
class PythonObserver : public Observer {
public:
    /// `progress`: None, or the function.
    explicit PythonObserver(py::object progress) : progress_(std::move(progress)) {}
    void progress(std::string_view stage, double fraction) override;
    void note(std::string_view message) override;
    bool cancel_requested() override;

    /// Throws what the function threw, or the user's interrupt; returns where there is none.
    void rethrow() const {
        if (thrown_) std::rethrow_exception(thrown_);
    }

private:
    /// Runs `call` with Python's lock; its exception stops everything.
    template <class Call>
    void with_python(const Call& call);

    py::object progress_;
    std::atomic<bool> stopped_{false};
    std::atomic<std::chrono::steady_clock::rep> asked_{0};
    std::exception_ptr thrown_;
};

/// `work(observer)` without Python's lock.
template <class Work>
auto observed(py::object progress, const Work& work) {
    PythonObserver observer(std::move(progress));
    try {
        const py::gil_scoped_release released;
        return work(observer);
    } catch (const Cancelled&) {
        observer.rethrow();
        throw;
    }
}

}  // namespace tissuewarp::python
