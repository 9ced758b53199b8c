#pragma once
/// A volume as a NIfTI-1 file holds it, in pieces: no second copy is made to write it.

#include "imaging/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace tissuewarp::imaging::detail {

/// The bytes that write_through_itk would write. The volume must outlive them.
class NiftiBytes {
public:
    /// `step`: of float32, to which every value is rounded. `scratch` names a file that may be written meanwhile: ITK
    /// makes the header, of a small volume in the same place. Throws IoError, also for more than 32 767 voxels along an
    /// axis, which the format cannot count.
    NiftiBytes(const Volume& volume, std::optional<double> step, const std::filesystem::path& scratch);

    [[nodiscard]] std::uint64_t size() const;
    /// Bytes [first, first + count), which begin and end with the header or a whole value. Thread-safe.
    void copy(std::uint64_t first, std::uint64_t count, unsigned char* target) const;

private:
    const Volume& volume_;
    std::optional<double> step_;
    std::string header_;

    void copy_values(std::uint64_t first, std::uint64_t count, unsigned char* target) const;
};

}  // namespace tissuewarp::imaging::detail
