#pragma once
/// The springs of NodalConditions by the internal numbers of the CPU engine.

#include "tled/conditions.hpp"
#include "tled/cpu/cpu_kernels.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

template <class T>
class CpuSprings {
public:
    CpuSprings() = default;

    /// `internal` numbers the nodes of the mesh.
    CpuSprings(const NodalConditions& conditions, const std::vector<std::uint32_t>& internal) {
        for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
            const auto column = static_cast<Eigen::Index>(s);
            Spring spring{internal[static_cast<std::size_t>(conditions.spring_node[s])], {}};
            for (int k = 0; k < 6; ++k)
                spring.k[static_cast<std::size_t>(k)] = T(conditions.spring_stiffness(k, column));
            for (int k = 0; k < 3; ++k)
                spring.k[static_cast<std::size_t>(6 + k)] = T(conditions.spring_force(k, column));
            springs_.push_back(spring);
        }
        std::sort(springs_.begin(), springs_.end(), [](const Spring& x, const Spring& y) { return x.node < y.node; });
    }

    /// Takes the forces of springs on internal nodes [begin, end) at displacement `u` off `force`, both records, mN.
    void take_off(const T* u, std::size_t begin, std::size_t end, T* force) const {
        auto spring = std::lower_bound(springs_.begin(), springs_.end(), begin,
                                       [](const Spring& each, std::size_t node) { return each.node < node; });
        for (; spring != springs_.end() && spring->node < end; ++spring) {
            const std::array<T, 9>& k = spring->k;
            const T *at = u + spring->node * std::size_t{record}, x = at[0], y = at[1], z = at[2];
            T* of_node = force + spring->node * std::size_t{record};
            of_node[0] -= k[6] - (k[0] * x + k[3] * y + k[5] * z);
            of_node[1] -= k[7] - (k[3] * x + k[1] * y + k[4] * z);
            of_node[2] -= k[8] - (k[5] * x + k[4] * y + k[2] * z);
        }
    }

    [[nodiscard]] bool empty() const { return springs_.empty(); }

private:
    struct Spring {
        std::uint32_t node;  // internal
        std::array<T, 9> k;  // K as tled/model/symmetric.hpp, K·target
    };
    std::vector<Spring> springs_;  // ascending
};

}  // namespace tissuewarp::tled::detail
