#include "registration/update.hpp"

#include "core/stopwatch.hpp"
#include "imaging/labels.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/engine_choice.hpp"
#include "registration/pose/start_pose.hpp"
#include "registration/register.hpp"
#include "registration/surroundings/rigid_surroundings.hpp"

#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::registration {

namespace {

std::vector<detail::ImageTools> image_tools_of(const PreparedModel& prepared, const UpdateOptions& options,
                                               Observer& observer) {
    if (!prepared.image) return {};
    const meshing::TetMesh& mesh = prepared.model.mesh;
    const auto locator = std::make_shared<const meshing::PointLocator>(mesh);
    std::vector<detail::ImageTools> tools;
    const auto add = [&](const ImageModel& image) {
        tools.push_back({detail::make_image_engine(mesh, image, options, observer), locator, {}});
    };
    add(*prepared.image);
    for (const auto& contrast : prepared.contrasts) add(*contrast);
    return tools;
}

}  // namespace

struct Updater::Impl {
    std::shared_ptr<const PreparedModel> prepared;
    UpdateOptions options;
    std::unique_ptr<tled::Engine> solver;
    std::vector<detail::ImageTools> image_tools;  // for the image of the model and each of its contrasts
    detail::LoadFinder load_finder;

    Impl(std::shared_ptr<const PreparedModel> model, const UpdateOptions& given, std::unique_ptr<tled::Engine> engine,
         Observer& observer)
        : prepared(std::move(model)),
          options(given),
          solver(std::move(engine)),
          image_tools(image_tools_of(*prepared, options, observer)),
          load_finder(*prepared, options.tissue) {}

    UpdateResult update(const Intraoperative& given, Observer& observer) {
        const Eigen::Isometry3d start = given.start.value_or(Eigen::Isometry3d::Identity());
        const Intraoperative seen = detail::without_neighbours(given.start ? detail::seen_from(given, start) : given,
                                                               prepared->options.rigid_neighbours);
        Stopwatch stopwatch;
        detail::Terms terms = detail::terms_of(*prepared, seen, options, image_tools);
        const double seconds = stopwatch.lap();
        UpdateResult result = detail::register_model(*prepared, terms, load_finder, *solver, options, observer);
        if (given.start) detail::return_to_fixed_frame(result, start);
        if (prepared->neighbours)
            result.deformation.surroundings =
                rigid_bodies(imaging::mask_of_all(prepared->neighbours->labels), result.deformation);
        result.times.insert(result.times.begin() + 1, {stages::boundary_maps, seconds});
        return result;
    }
};

Updater::Updater(std::shared_ptr<const PreparedModel> prepared, const UpdateOptions& options, Observer& observer)
    : Updater(prepared, options, detail::make_engine(*prepared, options, observer), observer) {}
Updater::Updater(PreparedModel&& prepared, const UpdateOptions& options, Observer& observer)
    : Updater(std::make_shared<const PreparedModel>(std::move(prepared)), options, observer) {}
Updater::Updater(std::shared_ptr<const PreparedModel> prepared, const UpdateOptions& options,
                 std::unique_ptr<tled::Engine> solver, Observer& observer)
    : impl_(std::make_unique<Impl>(std::move(prepared), options, std::move(solver), observer)) {}
Updater::~Updater() = default;
Updater::Updater(Updater&&) noexcept = default;
Updater& Updater::operator=(Updater&&) noexcept = default;

UpdateResult Updater::update(const Intraoperative& seen, Observer& observer) {
    try {
        return impl_->update(seen, observer);
    } catch (const GpuUnavailable& failure) {
        if (impl_->options.device != Device::Auto) throw;
        observer.note(std::string("the CPU takes over, and the update begins again: ") + failure.what());
        UpdateOptions options = impl_->options;
        options.device = Device::Cpu;
        const std::shared_ptr<const PreparedModel> prepared = impl_->prepared;
        impl_ = std::make_unique<Impl>(prepared, options, detail::make_engine(*prepared, options, observer), observer);
        return impl_->update(seen, observer);
    }
}

UpdateResult update(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                    Observer& observer) {
    const std::shared_ptr<const PreparedModel> borrowed(std::shared_ptr<const PreparedModel>(), &prepared);
    return Updater(borrowed, options, observer).update(seen, observer);
}

}  // namespace tissuewarp::registration
