/// Connections that misbehave, over sockets: each costs itself alone.
#include "server/hub.hpp"
#include "server/answers.hpp"
#include "tests/server/block.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <thread>

namespace tissuewarp::server {
namespace {

using ::testing::HasSubstr;

/// One end of a connection; nobody waits longer than 20 s.
class Peer {
public:
    explicit Peer(int port) : file_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        const timeval patience{20, 0};
        ::setsockopt(file_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        EXPECT_EQ(::connect(file_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    }
    ~Peer() { ::close(file_); }
    Peer(const Peer&) = delete;
    Peer& operator=(const Peer&) = delete;

    void send(ByteView bytes) const {
        EXPECT_EQ(::send(file_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
    }
    /// Texts until there are so many, or the connection ends.
    std::vector<std::string> texts(std::size_t count) {
        std::vector<std::string> texts;
        Bytes buffer(1 << 16);
        while (texts.size() < count) {
            const ssize_t got = ::recv(file_, buffer.data(), buffer.size(), 0);
            if (got <= 0) break;
            for (const Frame& frame : incoming_.feed({buffer.data(), static_cast<std::size_t>(got)}))
                if (frame.header.type == "STRING") texts.push_back(std::get<Text>(decode(frame)).text);
        }
        return texts;
    }
    /// Texts, up to and with this one.
    std::vector<std::string> texts_until(const std::string& last) {
        std::vector<std::string> all;
        do {
            const std::vector<std::string> more = texts(1);
            if (more.empty()) break;
            all.insert(all.end(), more.begin(), more.end());
        } while (all.back() != last);
        return all;
    }
    /// Whether the other end ends it.
    bool ends() {
        texts(1000000);
        return ::recv(file_, nullptr, 0, MSG_DONTWAIT) == 0 || errno == ECONNRESET;
    }

private:
    Limits limits_{.text_bytes = 1 << 17};
    Incoming incoming_{limits_};
    int file_;
};

/// A hub in a thread of its own.
class Serving {
public:
    explicit Serving(const Limits& limits)
        : hub({"127.0.0.1", 0, limits}, [this](const std::string& text) { keep(text); }),
          session_(test::block(), {}, hub),
          thread_([this] { hub.run(session_, [this] { return stop_.load(); }); }) {}
    ~Serving() {
        stop_ = true;
        thread_.join();
    }
    /// What the operator was told, once there is something with this word.
    std::string told(const std::string& word) {
        for (int n = 0; n < 400; ++n, std::this_thread::sleep_for(std::chrono::milliseconds(50))) {
            const std::scoped_lock lock(mutex_);
            for (const std::string& text : told_)
                if (text.find(word) != std::string::npos) return text;
        }
        return "";
    }

    Hub hub;

private:
    void keep(const std::string& text) {
        const std::scoped_lock lock(mutex_);
        told_.push_back(text);
    }
    std::mutex mutex_;
    std::vector<std::string> told_;
    Session session_;
    std::atomic<bool> stop_ = false;
    std::thread thread_;
};

Bytes info() {
    return framed("STRING", "request", encode(Text{R"({"do": "info"})"}));
}

TEST(Hub, WhoStopsWithinAMessageIsLetGo) {
    Serving serving({.silence_s = 0.3});
    Peer slow(serving.hub.port()), other(serving.hub.port());
    slow.send(ByteView(info()).first(70));
    EXPECT_TRUE(slow.ends());
    EXPECT_THAT(serving.told("not complete"), HasSubstr("client 1"));
    other.send(info());
    EXPECT_EQ(other.texts(1).size(), 1u);
}

TEST(Hub, MoreClientsThanItMayHaveAreSentAway) {
    Serving serving({.clients = 1});
    Peer first(serving.hub.port());
    first.send(info());
    EXPECT_EQ(first.texts(1).size(), 1u);
    Peer second(serving.hub.port());
    EXPECT_TRUE(second.ends());
    first.send(info());
    EXPECT_EQ(first.texts(1).size(), 1u);
}

TEST(Hub, WhoHasGoneMakesRoom) {
    Serving serving({.clients = 1});
    for (int n = 0; n < 5; ++n) {
        Peer peer(serving.hub.port());
        peer.send(info());
        ASSERT_EQ(peer.texts(1).size(), 1u) << n;
    }
}

TEST(Hub, WhoNeverReadsIsLetGoAndDelaysNobody) {
    Serving serving({.waiting_messages = 3});
    Peer deaf(serving.hub.port());
    deaf.send(info());
    Peer other(serving.hub.port());
    other.send(info());
    EXPECT_EQ(other.texts(1).size(), 1u);
    const auto large = std::make_shared<const Bytes>(framed("XYZ", "", Bytes(8 << 20)));
    for (int n = 0; n < 8; ++n) serving.hub.send(1, {"", {large}});
    other.send(info());
    EXPECT_EQ(other.texts(1).size(), 1u);
    EXPECT_THAT(serving.told("did not read"), HasSubstr("client 1"));
}

TEST(Hub, WhoReadsLateGetsTheNewestState) {
    Serving serving({});
    Peer late(serving.hub.port()), other(serving.hub.port());
    late.send(info());
    EXPECT_EQ(late.texts(1).size(), 1u);
    const std::string padding(40'000, '.');
    constexpr int count = 200;  // 8 MB, which the system would keep, each of them old
    for (int n = 1; n <= count; ++n) {
        serving.hub.show(parcel("organ", "STRING", "organ", encode(Text{std::to_string(n) + padding}), now_s()));
        EXPECT_EQ(other.texts(1).size(), 1u) << n;
    }
    serving.hub.show(said("end"));
    const std::vector<std::string> texts = late.texts_until("end");
    EXPECT_LT(texts.size(), 30u);  // 1 MB: of two systems' buffers
    ASSERT_GE(texts.size(), 2u);
    EXPECT_EQ(texts[texts.size() - 2], std::to_string(count) + padding);
}

TEST(Hub, MessagesBeyondTheRateWaitAndAreNotLost) {
    Serving serving({.messages_per_second = 200, .burst = 5});
    Peer eager(serving.hub.port());
    const auto begin = std::chrono::steady_clock::now();
    for (int n = 0; n < 60; ++n) {
        eager.send(info());
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(eager.texts(60).size(), 60u);
    EXPECT_GT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(100));
}

}  // namespace
}  // namespace tissuewarp::server
