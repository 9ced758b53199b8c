#pragma once
/// A description of displacement.h5 for ParaView and other readers of XDMF (version 2 of its XML): one mesh over time,
/// whose numbers stay in that file.

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::simulation {

/// Tetrahedra that are there from a resection on: datasets of the record.
struct XdmfStage {
    std::string tetrahedra, labels;
    int count = 0;
};

struct XdmfFrame {
    double time = 0.0;      ///< s
    std::size_t stage = 0;  ///< place in XdmfSeries::stages
};

struct XdmfSeries {
    std::string record;  ///< the file's name, beside the description
    int nodes = 0;
    std::vector<XdmfStage> stages;
    std::vector<XdmfFrame> frames;  ///< as many as `displacement` has
};

/// Throws IoError.
void write_xdmf(const XdmfSeries& series, const std::filesystem::path& path);

}  // namespace tissuewarp::simulation
