#pragma once
/// Composition of GLSL text from chunks: pure functions, no OpenGL.

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::shaders {

/// GLSL files by name: "kernels/<kernel>.comp", "render_pass/<kernel>.vert" and ".frag", "chunks/<chunk>.glsl".
using SourceLibrary = std::map<std::string, std::string>;

/// The files of shaders/, embedded at build time.
const SourceLibrary& embedded_sources();

/// Which files hold the main(): kernels/*.comp, render_pass/*.vert, render_pass/*.frag.
enum class ShaderStage { Compute, Vertex, Fragment };

/// What a program, or one stage of a render pass, is made of.
struct ProgramSource {
    std::string kernel;                          ///< "element_force" for kernels/element_force.comp
    std::vector<std::string> chunks;             ///< in the order in which they precede the kernel
    std::map<std::string, std::string> defines;  ///< value of every name that a file declares by `//! define NAME`
    std::vector<std::string> extensions;         ///< GLSL extensions to require
    ShaderStage stage = ShaderStage::Compute;
};

struct ComposedSource {
    std::string text;
    std::vector<std::string> files;  ///< files[K] is the file of number K, 0 the prolog
};

/// `#version 450 core`, extensions, `#define`s, chunks, kernel. Line N of file K is numbered K·10000 + N of source K by
/// a `#line` before each file: Mesa forgets the source in many messages, so the line alone tells the file. Throws
/// InvalidInput for an unknown file, a declared name without a value, and a value for a name that no file declares:
/// flags are always given both ways.
ComposedSource compose(const ProgramSource& source, const SourceLibrary& library = embedded_sources());

/// Identifies a program: equal keys, equal text (for one library).
std::string program_key(const ProgramSource& source);

/// A compiler's log with its positions ("K:N" or "K(N)" with the numbers of compose()) replaced by "file:N".
std::string readable_log(std::string_view log, const std::vector<std::string>& files);

}  // namespace tissuewarp::shaders
