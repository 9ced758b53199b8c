#pragma once
/// Structure sets that tests write themselves.

#include "tests/imaging/dicom_elements.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace tissuewarp::imaging::test {

constexpr const char* structure_set_storage = "1.2.840.10008.5.1.4.1.1.481.3";

/// A closed contour, and its kind.
struct Contour {
    std::vector<Eigen::Vector3d> points;
    const char* kind = "CLOSED_PLANAR";
};

struct Region {
    int number;
    std::string name;
    std::vector<Contour> contours;
    std::string type = "ORGAN";
};

/// All of a structure set, its points turned.
inline Elements structure_set(const std::vector<Region>& regions,
                              const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity()) {
    std::vector<Elements> names, drawn, observations;
    for (const Region& region : regions) {
        Elements name, contours;
        name.text(0x3006, 0x22, "IS", std::to_string(region.number));
        name.text(0x3006, 0x26, "LO", region.name);
        names.push_back(name);
        std::vector<Elements> items;
        for (const Contour& contour : region.contours) {
            Elements item;
            std::string data;
            for (const Eigen::Vector3d& point : contour.points) data.append("\\").append(decimals(turn * point));
            item.text(0x3006, 0x42, "CS", contour.kind);
            item.text(0x3006, 0x46, "IS", std::to_string(contour.points.size()));
            item.text(0x3006, 0x50, "DS", data.substr(1));
            items.push_back(item);
        }
        contours.sequence(0x3006, 0x40, items);
        contours.text(0x3006, 0x84, "IS", std::to_string(region.number));
        drawn.push_back(contours);
        Elements observation;
        observation.text(0x3006, 0x84, "IS", std::to_string(region.number));
        observation.text(0x3006, 0xa4, "CS", region.type);
        observations.push_back(observation);
    }
    Elements data;
    data.text(8, 0x60, "CS", "RTSTRUCT");
    data.sequence(0x3006, 0x20, names);
    data.sequence(0x3006, 0x39, drawn);
    data.sequence(0x3006, 0x80, observations);
    return data;
}

}  // namespace tissuewarp::imaging::test
