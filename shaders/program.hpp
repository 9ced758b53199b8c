#pragma once
/// Compute programs, compiled once per device and set of chunks.

#include "shaders/device.hpp"
#include "shaders/program_source.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::shaders {

/// A storage block of a linked program: every one that it reads or writes, and, by the driver's choice, declared ones
/// that it does not.
struct StorageBlock {
    std::string name;
    int binding = 0;
};

/// A linked compute program. Uniforms have explicit locations. All members need the device's context current, except
/// construction and destruction, which make it so.
class Program {
public:
    /// Throws GpuUnavailable with file:line and the compiler's words when the driver refuses the text.
    Program(const Device& device, const ComposedSource& source);
    ~Program();
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

    void set(int location, std::uint32_t value) const;
    void set(int location, float value) const;

    /// Runs at least `invocations` invocations; kernels find theirs by `invocation_index()` of chunks/index.glsl.
    void dispatch(std::size_t invocations) const;

    [[nodiscard]] const std::vector<StorageBlock>& storage_blocks() const { return blocks_; }
    [[nodiscard]] int workgroup_size() const { return workgroup_size_; }
    /// What it was composed of: the chunks in order, then the kernel.
    [[nodiscard]] const std::vector<std::string>& files() const { return files_; }

private:
    const Device& device_;
    unsigned id_ = 0;
    int workgroup_size_ = 1;
    std::vector<StorageBlock> blocks_;
    std::vector<std::string> files_;
};

/// The programs of one device, by key.
class ProgramCache {
public:
    explicit ProgramCache(const Device& device) : device_(device) {}
    const Program& get(const ProgramSource& source);
    [[nodiscard]] std::size_t size() const { return programs_.size(); }

private:
    const Device& device_;
    std::map<std::string, std::unique_ptr<Program>> programs_;
};

}  // namespace tissuewarp::shaders
