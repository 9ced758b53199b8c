// Files at a client's request.

#include "imaging/image_io.hpp"
#include "meshing/mesh_io.hpp"
#include "server/session.hpp"

#include <fmt/format.h>

namespace tissuewarp::server {

namespace {

void save(const Products& products, const std::string& name, const std::filesystem::path& path) {
    if (name != "organ") throw InvalidInput("'" + name + "' cannot be saved; organ can");
    if (path.extension() != ".vtp") throw InvalidInput("an organ is saved as .vtp");
    std::vector<meshing::MeshArray> arrays;
    for (const PointArray& array : products.organ.point_arrays) arrays.push_back({array.name, array.values});
    meshing::write_vtp({products.organ.points, products.organ.triangles}, path, arrays);
}

/// As if it had been sent, so that a replay sees the same. Other formats may name further files, anywhere.
Frame loaded_image(const std::string& name, const std::filesystem::path& path) {
    const std::string file = path.filename().string();
    if (!file.ends_with(".nii") && !file.ends_with(".nii.gz"))
        throw InvalidInput("'" + file + "' is no NIfTI image; .nii and .nii.gz are loaded");
    Frame frame;
    frame.header.type = "IMAGE";
    frame.header.device = name;
    frame.body = encode(name == "fixed_labels" ? imaging::read_labels(path) : imaging::read_volume(path));
    frame.header.body_bytes = frame.body.size();
    return frame;
}

}  // namespace

/// Files lie in the one folder, and what is loaded goes into the log as if it had been sent.
void Session::touch_file(const Received& received, const Request& request) {
    const std::filesystem::path path = file_in(options_.folder, request.file);
    if (request.names.size() != 1) throw InvalidInput("\"names\" says one name: what to load as, or organ to save");
    const std::string& name = request.names.front();
    if (request.what == Request::Do::Save) {
        std::shared_ptr<const Products> last;
        {
            const std::scoped_lock lock(mutex_);
            last = last_;
        }
        if (!last) throw InvalidInput("there is no result to save yet");
        save(*last, name, path);
        return refuse(received.client, request, "ok", "saved '" + request.file + "'");
    }
    Received loaded;
    loaded.client = received.client;
    loaded.frame = loaded_image(name, path);
    take_in(loaded, decode(loaded.frame));
    refuse(received.client, request, "ok", fmt::format("state {}", scene_.state()));
}

}  // namespace tissuewarp::server
