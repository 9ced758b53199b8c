#pragma once
#include "core/observer.hpp"

#include <string>

namespace tissuewarp::test {

/// Keeps what it is told, a line each.
class Noted : public Observer {
public:
    void note(std::string_view text) override { notes.append(text).append("\n"); }
    std::string notes;
};

}  // namespace tissuewarp::test
