#pragma once
/// A patient that is prepared in no time.

#include "server/patient.hpp"
#include "tests/registration/shapes.hpp"

namespace tissuewarp::server::test {

/// Of 40 mm × 40 mm, with edges of 8 mm, and labels about it.
inline ServedPatient block(int length = 40) {
    imaging::Volume labels(registration::test::plain_grid({60, 60, length + 20}, 1.0, {-10, -10, -10}), CV_32SC1);
    for (int k = 10; k < length + 10; ++k)
        for (int j = 10; j < 50; ++j)
            for (int i = 10; i < 50; ++i) labels.data<int>()[labels.offset(i, j, k)] = 1;
    auto model = std::make_shared<registration::PreparedModel>(registration::prepare(
        registration::test::box_at({0, 0, 0}, {40, 40, double(length)}, {5, 5, length / 8}), labels));
    registration::UpdateOptions cpu;
    cpu.device = registration::Device::Cpu;
    return {model, {}, labels, "digest of the patient", cpu};
}

}  // namespace tissuewarp::server::test
