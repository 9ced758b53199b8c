#include "shaders/timer.hpp"

#include "shaders/detail/gl.hpp"

namespace tissuewarp::shaders {

GpuTimer::GpuTimer(const Device& device) : device_(device) {
    const CurrentContext current = device.make_current();
    glCreateQueries(GL_TIME_ELAPSED, 1, &query_);
}

GpuTimer::~GpuTimer() {
    detail::release_with_context(device_, [this] { glDeleteQueries(1, &query_); });
}

void GpuTimer::start() {
    glBeginQuery(GL_TIME_ELAPSED, query_);
}

void GpuTimer::stop() {
    glEndQuery(GL_TIME_ELAPSED);
    check_errors("timer query");
}

double GpuTimer::seconds() const {
    GLuint64 nanoseconds = 0;
    glGetQueryObjectui64v(query_, GL_QUERY_RESULT, &nanoseconds);
    return static_cast<double>(nanoseconds) * 1e-9;
}

}  // namespace tissuewarp::shaders
