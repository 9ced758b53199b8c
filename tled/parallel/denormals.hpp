#pragma once
/// Numbers too small for a full mantissa, which motion that dies away passes through: many processors take a hundred
/// times as long for them.

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace tissuewarp::tled::detail {

/// While this lives, the thread takes denormal numbers for zero, on processors where that is a setting of its own.
class DenormalsAsZero {
public:
    DenormalsAsZero(const DenormalsAsZero&) = delete;
    DenormalsAsZero& operator=(const DenormalsAsZero&) = delete;
#if defined(__SSE__)
    DenormalsAsZero() : before_(_mm_getcsr()) {
        constexpr unsigned flush_to_zero = 1U << 15, denormals_are_zero = 1U << 6;
        _mm_setcsr(before_ | flush_to_zero | denormals_are_zero);
    }
    ~DenormalsAsZero() {
        _mm_setcsr(before_);
    }

private:
    unsigned before_;
#else
    DenormalsAsZero() {}
    ~DenormalsAsZero() {}
#endif
};

}  // namespace tissuewarp::tled::detail
