// The schema of 3D Slicer's markups, version 1.0.3.

#include "core/atomic_file.hpp"
#include "registration/io/slicer_markups.hpp"

#include <nlohmann/json.hpp>

namespace tissuewarp::registration {

void write_slicer_markups(const std::vector<MarkupPoint>& points, const std::filesystem::path& path) {
    using nlohmann::json;
    json list = {{"type", "Fiducial"}, {"coordinateSystem", "LPS"}, {"coordinateUnits", "mm"}, {"locked", true}};
    json& control_points = list["controlPoints"] = json::array();
    for (const MarkupPoint& point : points)
        control_points.push_back({{"id", std::to_string(control_points.size() + 1)},
                                  {"label", point.label},
                                  {"description", point.description},
                                  {"position", {point.position[0], point.position[1], point.position[2]}},
                                  {"selected", true},
                                  {"visibility", true},
                                  {"positionStatus", "defined"}});
    const json file = {{"@schema",
                        "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/"
                        "Schema/markups-schema-v1.0.3.json#"},
                       {"markups", json::array({list})}};
    write_file(file.dump(1, ' ', false, json::error_handler_t::replace) + "\n", path);
}

}  // namespace tissuewarp::registration
