#include "tests/fuzz/allocations.hpp"

#include <malloc.h>
#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>

#if defined(__SANITIZE_ADDRESS__)
// Of the sanitizer's runtime; its headers are not part of every compiler's package.
extern "C" {
int __sanitizer_install_malloc_and_free_hooks(void (*)(const volatile void*, std::size_t),
                                              void (*)(const volatile void*));
std::size_t __sanitizer_get_allocated_size(const volatile void*);
}
#endif

namespace {

std::atomic<bool> watching{false};
std::atomic<std::ptrdiff_t> held{0}, peak{0};
std::atomic<std::size_t> most{0}, refused{0};
std::atomic<unsigned char> fill{0};

void raise_to(auto& maximum, auto value) {
    auto before = maximum.load();
    while (before < value && !maximum.compare_exchange_weak(before, value)) {
    }
}

void took(std::size_t bytes) {
    if (watching) raise_to(peak, held += static_cast<std::ptrdiff_t>(bytes));
}

void gave(std::size_t bytes) {
    if (watching) held -= static_cast<std::ptrdiff_t>(bytes);
}

/// In copies of the process that a reader makes memory is filled as the reader has it.
const int in_copies = pthread_atfork(nullptr, nullptr, [] { watching = false; });

}  // namespace

namespace tissuewarp::fuzz {

void watch_allocations(std::size_t most_bytes, unsigned char pattern) {
    held = peak = 0;
    refused = 0;
    most = most_bytes;
    fill = pattern;
    watching = true;
}

void stop_watching() {
    watching = false;
}

std::size_t peak_bytes() {
    return static_cast<std::size_t>(std::max<std::ptrdiff_t>(peak, 0));
}

std::ptrdiff_t held_bytes() {
    return held;
}

std::size_t refused_bytes() {
    return refused;
}

}  // namespace tissuewarp::fuzz

#if defined(__SANITIZE_ADDRESS__)

// The sanitizer tells of every allocation; it turns down those above a limit of its own.
extern "C" const char* __asan_default_options() {
    return "allocator_may_return_null=1:max_allocation_size_mb=2048:detect_leaks=0:intercept_tls_get_addr=0:"
           "abort_on_error=0:quarantine_size_mb=16";
}

namespace {
const int installed = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t bytes) { took(bytes); },
    [](const volatile void* address) { gave(__sanitizer_get_allocated_size(address)); });
}

#else

// glibc's allocator under other names: every call of the process, of shared libraries too, comes by here.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
}

namespace {

bool too_much(std::size_t bytes) {
    if (!watching || held + static_cast<std::ptrdiff_t>(std::min<std::size_t>(bytes, PTRDIFF_MAX / 2)) <=
                         static_cast<std::ptrdiff_t>(most.load()))
        return false;
    raise_to(refused, bytes);
    errno = ENOMEM;
    return true;
}

void* counted(void* address, bool filled) {
    if (address == nullptr || !watching) return address;
    const std::size_t bytes = malloc_usable_size(address);
    took(bytes);
    if (filled) std::memset(address, fill, bytes);
    return address;
}

}  // namespace

extern "C" {

void* malloc(std::size_t bytes) {
    return too_much(bytes) ? nullptr : counted(__libc_malloc(bytes), true);
}

void* calloc(std::size_t count, std::size_t bytes) {
    if (bytes != 0 && count > PTRDIFF_MAX / bytes) return nullptr;
    return too_much(count * bytes) ? nullptr : counted(__libc_calloc(count, bytes), false);
}

void* realloc(void* address, std::size_t bytes) {
    const std::size_t before = address ? malloc_usable_size(address) : 0;
    if (bytes > before && too_much(bytes - before)) return nullptr;
    void* moved = __libc_realloc(address, bytes);
    if (moved == nullptr) {
        if (bytes == 0) gave(before);
        return nullptr;
    }
    gave(before);
    const std::size_t now = malloc_usable_size(moved);
    took(now);
    if (watching && now > before) std::memset(static_cast<char*>(moved) + before, fill, now - before);
    return moved;
}

void* memalign(std::size_t alignment, std::size_t bytes) {
    return too_much(bytes) ? nullptr : counted(__libc_memalign(alignment, bytes), true);
}

void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
    return memalign(alignment, bytes);
}

int posix_memalign(void** address, std::size_t alignment, std::size_t bytes) {
    *address = memalign(alignment, bytes);
    return *address ? 0 : ENOMEM;
}

void free(void* address) {
    if (address != nullptr) gave(malloc_usable_size(address));
    __libc_free(address);
}
}

#endif
