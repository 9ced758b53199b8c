#include "tled/engine.hpp"

namespace tissuewarp::tled {

std::string name_of_element(int tet, int hex) {
    return hex >= 0 ? "hexahedron " + std::to_string(hex) : "tetrahedron " + std::to_string(tet);
}

}  // namespace tissuewarp::tled
