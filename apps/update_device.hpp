#pragma once
/// --device for registrations.

#include "apps/options.hpp"
#include "registration/update.hpp"

namespace tissuewarp::apps {

/// The defaults on a device that check_device let through.
registration::UpdateOptions on_device(const DeviceChoice& device);

}  // namespace tissuewarp::apps
