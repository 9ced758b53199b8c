// Damaged messages for the server: fuzz_wire --seed 1 --count 100000
//
// Right messages of every type are damaged (bits, numbers, pieces of others, cut and grown), mostly with length and
// checksum made right again, so that damage gets past them. A case is good when it is taken in, or thrown out by
// InvalidInput in at most 4000 characters, and takes at most ten times its bytes and 16 MiB of memory.

#include "server/crc64.hpp"
#include "server/incoming.hpp"
#include "server/request.hpp"
#include "server/scene.hpp"
#include "tests/fuzz/allocations.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <string_view>

namespace {

using namespace tissuewarp;
using namespace tissuewarp::server;

using Random = std::mt19937_64;

std::size_t below(Random& random, std::size_t bound) {
    return bound == 0 ? 0 : random() % bound;
}

std::vector<Bytes> right_messages() {
    std::vector<Bytes> seeds;
    const auto add = [&](const char* type, const char* device, const Bytes& body) {
        seeds.push_back(framed(type, device, body));
    };
    NamedPoints points;
    for (int n = 0; n < 5; ++n) points.push_back({"p" + std::to_string(n), "", Eigen::Vector3d(n, 2 * n, 3)});
    for (const char* device : {"moving_points", "fixed_points", "targets", "touched"})
        add("POINT", device, encode(points));
    PolyData mesh;
    mesh.points = Eigen::Matrix3Xd::Random(3, 12);
    mesh.normals = mesh.points.colwise().normalized();
    mesh.lines = {{0, 1, 2, 3}, {4, 5}};
    mesh.triangles = (Eigen::Matrix3Xi(3, 2) << 0, 1, 2, 3, 4, 5).finished();
    mesh.point_arrays = {{"abc", Eigen::RowVectorXd::Ones(12)}};
    for (const char* device : {"fixed_surface", "moving_curves", "fixed_curves"}) add("POLYDATA", device, encode(mesh));
    imaging::Geometry grid;
    grid.size = {5, 4, 3};
    for (const int type : {CV_8UC1, CV_16SC1, CV_32FC1}) {
        imaging::Volume image(grid, type);
        image.voxels.setTo(1);
        add("IMAGE", type == CV_8UC1 ? "fixed_labels" : "fixed", encode(image));
    }
    add("STRING", "request", encode(Text{R"({"do":"gather","id":"left","spacing_mm":2,"keep_s":60})"}));
    for (const char* device : {"start", "stylus"})
        seeds.push_back(framed("TRANSFORM", device, encode(Eigen::Isometry3d::Identity()), std::uint64_t{1000} << 32));
    add("STATUS", "x", encode(Status{1, "name", "text"}));
    for (const char* text :
         {R"({"do":"update","sequence":3,"use":["fixed_points"],"send":["field"],"points_sd_mm":0.5})",
          R"({"do":"forget","ids":["p1","left"]})", R"({"do":"load","file":"a.nii","names":["fixed"],"align":true})"})
        add("STRING", "request", encode(Text{text}));
    Writer second;  // a body of version 2
    second.u16(12);
    second.u16(0);
    second.u32(4);
    second.u32(1);
    second.raw(encode(Text{R"({"do":"info"})"}));
    second.text("meta", 4);
    Bytes later = framed("STRING", "request", second.bytes());
    later[1] = 2;
    seeds.push_back(later);
    return seeds;
}

/// Numbers that readers believe: small, large, and just beyond.
void overwrite_number(Bytes& bytes, Random& random) {
    constexpr std::uint64_t values[] = {0,      1,      2,       0x7f,       0xff,       0x100,
                                        0x7fff, 0xffff, 0x10000, 0x7fffffff, 0xffffffff, ~0ull};
    const std::size_t width = std::size_t{1} << below(random, 4);
    if (bytes.size() < width) return;
    const std::size_t at = below(random, bytes.size() - width + 1);
    const std::uint64_t value = values[below(random, std::size(values))];
    for (std::size_t k = 0; k < width; ++k) bytes[at + k] = static_cast<unsigned char>(value >> (8 * (width - 1 - k)));
}

void damage(Bytes& bytes, const std::vector<Bytes>& seeds, Random& random) {
    const auto place = [&] { return bytes.begin() + static_cast<std::ptrdiff_t>(below(random, bytes.size() + 1)); };
    switch (below(random, 6)) {
        case 0:
            if (!bytes.empty()) bytes[below(random, bytes.size())] ^= static_cast<unsigned char>(1 << below(random, 8));
            break;
        case 1:
        case 2:
            overwrite_number(bytes, random);
            break;
        case 3:
            bytes.erase(place(), bytes.end());
            break;
        case 4: {
            const Bytes more(below(random, 50), static_cast<unsigned char>(random()));
            bytes.insert(place(), more.begin(), more.end());
            break;
        }
        default: {
            const Bytes& other = seeds[below(random, seeds.size())];
            const std::size_t from = below(random, other.size()), count = below(random, other.size() - from);
            bytes.insert(place(), other.begin() + static_cast<std::ptrdiff_t>(from),
                         other.begin() + static_cast<std::ptrdiff_t>(from + count));
        }
    }
}

Bytes damaged(const std::vector<Bytes>& seeds, Random& random) {
    Bytes message = seeds[below(random, seeds.size())];
    const std::size_t changes = 1 + below(random, 3);
    if (below(random, 4) == 0) {  // anywhere, header included
        for (std::size_t n = 0; n < changes; ++n) damage(message, seeds, random);
        return message;
    }
    Bytes body(message.begin() + header_bytes, message.end());
    for (std::size_t n = 0; n < changes; ++n) damage(body, seeds, random);
    const Header old = parse_header(ByteView(message).first(header_bytes), {});
    Bytes again = framed(old.type, old.device, body);
    again[1] = static_cast<unsigned char>(old.version);
    return again;
}

/// As a server takes it in, in pieces. True when it was taken.
bool take(const Bytes& message, const Limits& limits, Scene& scene, Random& random) {
    Incoming incoming(limits);
    std::vector<Frame> frames;
    for (std::size_t at = 0; at < message.size();) {
        const std::size_t count = std::min(message.size() - at, 1 + below(random, 200));
        for (Frame& frame : incoming.feed(ByteView(message).subspan(at, count))) frames.push_back(std::move(frame));
        at += count;
    }
    for (const Frame& frame : frames) {
        const Message said = decode(frame);
        if (const auto* text = std::get_if<Text>(&said))
            apply(parse_request(text->text), scene);
        else
            scene.take(frame.header.device, said, seconds_of(frame.header));
        if (!scene.data().empty()) static_cast<void>(scene.seen({}, {}));
    }
    return !frames.empty();
}

struct Count {
    long taken = 0, refused = 0, failed = 0;
};

void run_case(const std::vector<Bytes>& seeds, std::uint64_t seed, Scene& scene, Count& count) {
    Random random(seed);
    const Bytes message = damaged(seeds, random);
    const std::size_t most = 10 * message.size() + (16u << 20);
    std::string problem;
    fuzz::watch_allocations(most, 0xa5);
    try {
        take(message, {}, scene, random) ? ++count.taken : ++count.refused;
    } catch (const InvalidInput& refusal) {
        ++count.refused;
        if (std::string_view(refusal.what()).size() > 4000) problem = "a message that is too long";
    } catch (const std::exception& other) {
        problem = other.what();
    }
    fuzz::stop_watching();
    if (fuzz::refused_bytes() > 0) problem = "it asked for " + std::to_string(fuzz::refused_bytes()) + " bytes";
    if (problem.empty()) return;
    ++count.failed;
    std::printf("case %llu: %s\n", static_cast<unsigned long long>(seed), problem.c_str());
}

}  // namespace

int main(int arguments, char** words) {
    std::uint64_t seed = 1;
    long cases = 20000;
    for (int n = 1; n + 1 < arguments; n += 2) {
        if (std::string_view(words[n]) == "--seed") seed = std::strtoull(words[n + 1], nullptr, 10);
        if (std::string_view(words[n]) == "--count") cases = std::strtol(words[n + 1], nullptr, 10);
    }
    const std::vector<Bytes> seeds = right_messages();
    Scene scene;
    Random random(seed);
    for (const Bytes& message : seeds)
        if (!take(message, {}, scene, random)) {
            std::printf("a right message was not taken\n");
            return 1;
        }
    Count count;
    for (long n = 0; n < cases; ++n)
        run_case(seeds, seed * 1'000'000'007 + static_cast<std::uint64_t>(n), scene, count);
    std::printf("%ld messages: %ld taken, %ld refused, %ld failed\n", cases, count.taken, count.refused, count.failed);
    return count.failed > 0 || count.taken < cases / 100 || count.refused < cases / 100;
}
