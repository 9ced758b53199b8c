#pragma once
/// The frames of a run as files, in one folder:
///   frame_0000.vtu …, frames.pvd   mesh with displacement (mm) and J for ParaView, one file for each frame
///   displacement.h5, frames.xdmf   the mesh once and the displacement of every frame (docs/manual/simulate.md), and
///                                  what makes a series for ParaView of it
///   probes.csv                     time_s,probe,x_mm,y_mm,z_mm,dx_mm,dy_mm,dz_mm: where it was at rest, how far it
///   went

#include "simulation/run.hpp"

#include <filesystem>
#include <memory>

namespace tissuewarp::simulation {

/// Of displacement.h5.
inline constexpr const char* series_format = "tissuewarp simulation";
inline constexpr int series_version = 1;

class SeriesWriter {
public:
    /// Holds a reference. Throws IoError.
    SeriesWriter(const BuiltScene& built, const std::filesystem::path& folder);
    ~SeriesWriter();
    SeriesWriter(const SeriesWriter&) = delete;
    SeriesWriter& operator=(const SeriesWriter&) = delete;

    /// Throws IoError.
    void add(const Frame& frame);
    /// Completes the files. Throws IoError.
    void finish();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::simulation
