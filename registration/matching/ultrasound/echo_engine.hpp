#pragma once
/// Where echoes are compared with what the moving image shows: on the processor, or in shaders on a device.

#include "registration/matching/ultrasound/echo_costs.hpp"
#include "registration/matching/ultrasound/structure_costs.hpp"

namespace tissuewarp::registration::detail {

class EchoEngine {
public:
    virtual ~EchoEngine() = default;

    /// As echo_costs.
    virtual EchoCosts linear_combination(const EchoImages& images, const EchoCostOptions& options) = 0;
    /// As structure_costs.
    virtual EchoCosts structure(const EchoImages& images, const StructureCostOptions& options) = 0;
};

class CpuEchoEngine : public EchoEngine {
public:
    EchoCosts linear_combination(const EchoImages& images, const EchoCostOptions& options) override {
        return echo_costs(images, options);
    }
    EchoCosts structure(const EchoImages& images, const StructureCostOptions& options) override {
        return structure_costs(images, options);
    }
};

}  // namespace tissuewarp::registration::detail
