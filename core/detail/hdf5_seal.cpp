#include "core/detail/hdf5_seal.hpp"

#include "core/detail/hdf5_structure.hpp"
#include "core/errors.hpp"
#include "core/sha256.hpp"

#include <fstream>
#include <string>

namespace tissuewarp {

namespace {

constexpr std::string_view title = "tissuewarp sha256 ";

std::string seal_of(const std::filesystem::path& path) {
    std::string seal = std::string(title) + sha256_of_file(path, hdf5_seal_bytes) + "\n";
    seal.resize(hdf5_seal_bytes);
    return seal;
}

}  // namespace

void seal_hdf5(const std::filesystem::path& path) {
    const std::string seal = seal_of(path);
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.write(seal.data(), static_cast<std::streamsize>(seal.size()));
    file.close();
    if (!file) throw IoError("cannot write '" + path.string() + "'; is the disk full?");
}

void require_unbroken_hdf5(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::string head(hdf5_seal_bytes, '\0');
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(file.gcount()));
    if (head.starts_with("\x89HDF")) return detail::require_sound_hdf5(path);
    if (!head.starts_with(title))
        throw IoError("'" + path.string() + "' cannot be read as HDF5; is it complete, and the file you meant?");
    if (head != seal_of(path))
        throw IoError("'" + path.string() +
                      "' is damaged: its bytes are not those that were written; copy the file again, or write it anew");
}

}  // namespace tissuewarp
