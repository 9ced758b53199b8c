#include "python/core/observer.hpp"

#include <string>

namespace tissuewarp::python {

template <class Call>
void PythonObserver::with_python(const Call& call) {
    if (stopped_) return;
    const py::gil_scoped_acquire python;
    if (stopped_) return;
    try {
        call();
    } catch (py::error_already_set&) {
        thrown_ = std::current_exception();
        stopped_ = true;
    }
}

void PythonObserver::progress(std::string_view stage, double fraction) {
    if (progress_.is_none()) return;
    with_python([&] {
        if (progress_(std::string(stage), fraction).ptr() == Py_False) stopped_ = true;
    });
}

void PythonObserver::note(std::string_view message) {
    with_python([&] {
        py::module_::import("logging").attr("getLogger")("tissuewarp").attr("info")("%s", std::string(message));
    });
}

bool PythonObserver::cancel_requested() {
    using Clock = std::chrono::steady_clock;
    constexpr Clock::duration interval = std::chrono::milliseconds(50);  // between looks for an interrupt
    const auto now = Clock::now().time_since_epoch().count();
    if (now - asked_ > interval.count()) {
        asked_ = now;
        with_python([] {
            if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        });
    }
    return stopped_;
}

}  // namespace tissuewarp::python
