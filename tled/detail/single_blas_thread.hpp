#pragma once

namespace tissuewarp::tled::detail {

/// One thread of the BLAS for the whole process while any of these lives, where the BLAS is OpenBLAS: its threads wait
/// for each other by spinning, which on small supernodes costs more than it gives, and multiplies the time on busy
/// cores.
class SingleBlasThread {
public:
    SingleBlasThread();
    ~SingleBlasThread();
    SingleBlasThread(const SingleBlasThread&) = delete;
    SingleBlasThread& operator=(const SingleBlasThread&) = delete;
};

}  // namespace tissuewarp::tled::detail
