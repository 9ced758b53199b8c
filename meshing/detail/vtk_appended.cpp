#include "meshing/detail/vtk_appended.hpp"

#include "core/errors.hpp"

namespace tissuewarp::meshing::detail {

std::string xml_escaped(const std::string& text) {
    std::string result;
    for (char c : text) {
        switch (c) {
            case '&':
                result += "&amp;";
                break;
            case '<':
                result += "&lt;";
                break;
            case '>':
                result += "&gt;";
                break;
            case '"':
                result += "&quot;";
                break;
            default:
                result += c;
        }
    }
    return result;
}

std::string float_arrays(VtkAppended& data, const std::vector<MeshArray>& arrays, Eigen::Index count,
                         const char* what) {
    std::string elements;
    for (const MeshArray& array : arrays) {
        if (array.values.cols() != count || array.values.rows() == 0)
            throw InvalidInput("array '" + array.name + "' of a VTK file has " + std::to_string(array.values.cols()) +
                               " columns for " + std::to_string(count) + " " + what + "; give one column each");
        const Eigen::MatrixXf values = array.values.cast<float>();
        elements += data.array("Float32", array.name, values.rows(),
                               std::vector<float>(values.data(), values.data() + values.size()));
    }
    return elements;
}

}  // namespace tissuewarp::meshing::detail
