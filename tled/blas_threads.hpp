#pragma once
/// Threads of the BLAS and of OpenMP under factors and triangular solves.

namespace tissuewarp::tled {

/// Whether triangular solves and small factors may set OpenBLAS to one thread while they run, and back to what it was.
/// Its threads wait for each other by spinning, which on small supernodes costs more than it gives and multiplies the
/// time on busy cores. But it has one number for the whole process, which the process alone may give away: whatever
/// else calls that BLAS in the meantime runs on one thread too. Not allowed until this is called; the last bits of
/// large factors depend on the number of threads. Call it while nothing is being solved. No effect on any other BLAS.
void let_solves_take_one_blas_thread(bool allowed);

namespace detail {

/// One thread of OpenBLAS for the whole process while any of these lives, if that is allowed.
class SingleBlasThread {
public:
    SingleBlasThread();
    ~SingleBlasThread();
    SingleBlasThread(const SingleBlasThread&) = delete;
    SingleBlasThread& operator=(const SingleBlasThread&) = delete;

    /// Whether calls of the BLAS take one thread now, so that several may be made at once.
    [[nodiscard]] bool holds() const;

private:
    bool counts_;
};

/// Parallel regions of OpenMP that this thread comes to have one thread while this lives. CHOLMOD asks for four
/// whatever the process may use, and they wait for each other by spinning: of eight processes on sixteen cores each
/// took eight times as long. No effect without OpenMP.
class SerialOpenMp {
public:
    SerialOpenMp();
    ~SerialOpenMp();
    SerialOpenMp(const SerialOpenMp&) = delete;
    SerialOpenMp& operator=(const SerialOpenMp&) = delete;

private:
    int levels_before_;
};

}  // namespace detail

}  // namespace tissuewarp::tled
