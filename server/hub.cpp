#include "server/hub.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

namespace tissuewarp::server {

namespace {

constexpr std::size_t bytes_at_once = 256 * 1024;  // from or to one client, then it is the next one's turn
constexpr double least_bytes_per_second = 100e3;   // of a message, beyond Limits::silence_s
// More than this the system does not take for one client before it has left: what waits there gets old, and no newer
// state can take its place.
constexpr int unsent_bytes = 64 * 1024;

union Address {
    sockaddr any;
    sockaddr_in four;
    sockaddr_in6 six;
};

socklen_t parse_address(const HubOptions& options, Address& address) {
    std::memset(&address, 0, sizeof address);
    const auto port = htons(static_cast<std::uint16_t>(options.port));
    if (inet_pton(AF_INET, options.address.c_str(), &address.four.sin_addr) == 1) {
        address.four.sin_family = AF_INET;
        address.four.sin_port = port;
        return sizeof address.four;
    }
    if (inet_pton(AF_INET6, options.address.c_str(), &address.six.sin6_addr) == 1) {
        address.six.sin6_family = AF_INET6;
        address.six.sin6_port = port;
        return sizeof address.six;
    }
    throw InvalidInput("'" + options.address + "' is no address; give numbers, for instance 127.0.0.1");
}

}  // namespace

/// One connection, and what is known of whoever is at its other end.
struct Hub::Client {
    Client(int socket, const Limits& limits) : file(socket), incoming(limits), tokens(limits.burst) {}
    ~Client() { ::close(file); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    void go(const std::string& why) {
        if (gone.empty()) gone = why;
    }

    int file;
    Incoming incoming;
    Outgoing outgoing;
    double tokens;  ///< messages that it may send now
    Clock::time_point counted = Clock::now(), began = counted;
    bool half_closed = false;
    std::string gone;  ///< why, or empty
};

Hub::Hub(const HubOptions& options, Note note) : options_(options), note_(std::move(note)) {
    Address address;
    const socklen_t length = parse_address(options_, address);
    const auto fail = [&](const char* what) {
        const std::string why = std::strerror(errno);
        if (listener_ >= 0) ::close(listener_);
        throw IoError(fmt::format("cannot {} {} port {}: {}", what, options_.address, options_.port, why));
    };
    listener_ = ::socket(address.any.sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener_ < 0) fail("open");
    const int on = 1;
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (::bind(listener_, &address.any, length) != 0) fail("bind");
    if (::listen(listener_, 16) != 0) fail("listen on");
    socklen_t size = sizeof address;
    ::getsockname(listener_, &address.any, &size);
    port_ = ntohs(address.any.sa_family == AF_INET ? address.four.sin_port : address.six.sin6_port);
    wake_ = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (wake_ < 0) fail("wait on");
}

Hub::~Hub() {
    clients_.clear();
    ::close(listener_);
    ::close(wake_);
}

void Hub::post(Post entry) {
    {
        const std::scoped_lock lock(mutex_);
        posts_.push_back(std::move(entry));
    }
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_, &one, sizeof one);  // full: it wakes anyway
}

void Hub::send(std::uint32_t client, const Parcel& parcel) {
    post({client, 0, parcel, {}});
}
void Hub::show(const Parcel& parcel, std::uint32_t except) {
    post({0, except, parcel, {}});
}
void Hub::drop(std::uint32_t client, const std::string& why) {
    post({client, 0, {}, why});
}
void Hub::note(const std::string& text) {
    note_(text);
}

void Hub::take_posts() {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t got = ::read(wake_, &count, sizeof count);
    std::vector<Post> posts;
    {
        const std::scoped_lock lock(mutex_);
        posts.swap(posts_);
    }
    for (const Post& entry : posts) {
        if (entry.client == 0) {
            newest_[entry.parcel.key] = entry.parcel;
            std::erase(shown_order_, entry.parcel.key);
            shown_order_.push_back(entry.parcel.key);
            for (auto& [id, client] : clients_)
                if (id != entry.except) client.outgoing.add(entry.parcel);
        } else if (const auto found = clients_.find(entry.client); found != clients_.end()) {
            if (entry.drop.empty())
                found->second.outgoing.add(entry.parcel);
            else
                found->second.go(entry.drop);
        }
    }
}

/// Whoever closed an end may be gone altogether, and has to make room.
void Hub::remove_half_closed(Session& session) {
    for (auto& [id, client] : clients_)
        if (client.half_closed) client.go("it had closed its end");
    remove_gone(session);
}

void Hub::accept_clients(Session& session) {
    while (true) {
        const int file = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (file < 0) return;
        if (clients_.size() >= options_.limits.clients) remove_half_closed(session);
        if (clients_.size() >= options_.limits.clients) {
            ::close(file);
            note_(fmt::format("{} clients are the most; another was sent away", options_.limits.clients));
            continue;
        }
        const int on = 1;
        ::setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
        ::setsockopt(file, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
        ::setsockopt(file, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent_bytes, sizeof unsent_bytes);
        const auto [client, added] = clients_.try_emplace(++last_client_, file, options_.limits);
        for (const std::string& key : shown_order_) client->second.outgoing.add(newest_.at(key));
    }
}

bool Hub::may_read(Client& client, const Session& session) const {
    const Clock::time_point now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - client.counted).count();
    client.counted = now;
    client.tokens = std::min(options_.limits.burst, client.tokens + seconds * options_.limits.messages_per_second);
    std::uint64_t in_flight = session.waiting_bytes();
    for (const auto& [id, other] : clients_) in_flight += other.incoming.kept_bytes();
    // A message that has begun may end: it is within its own limit.
    const bool room = in_flight < options_.limits.bytes_in_flight || client.incoming.promised_bytes() > 0;
    return !client.half_closed && client.tokens >= 1 && room;
}

void Hub::read_from(Client& client, Session& session) {
    static thread_local std::array<unsigned char, bytes_at_once> buffer;
    const ssize_t count = ::recv(client.file, buffer.data(), buffer.size(), 0);
    if (count < 0) {
        if (errno != EAGAIN && errno != EINTR) client.go(std::strerror(errno));
        return;
    }
    if (count == 0) {
        if (client.incoming.within_message()) return client.go("it ended within a message");
        client.half_closed = true;  // answers may still be read
        client.began = Clock::now();
        return;
    }
    const bool within = client.incoming.within_message();
    const auto id =
        std::find_if(clients_.begin(), clients_.end(), [&](auto& c) { return &c.second == &client; })->first;
    try {
        std::vector<Frame> frames = client.incoming.feed({buffer.data(), static_cast<std::size_t>(count)});
        if (!within || !frames.empty()) client.began = Clock::now();
        client.tokens -= static_cast<double>(frames.size());
        for (Frame& frame : frames) session.receive(id, std::move(frame));
    } catch (const BadMessage& problem) {
        client.go(problem.what());
    }
}

void Hub::write_to(Client& client) {
    std::size_t left = 16 * bytes_at_once;
    while (client.outgoing.waiting() > 0 && left > 0) {
        const ByteView next = client.outgoing.next().first(std::min(client.outgoing.next().size(), left));
        const ssize_t count = ::send(client.file, next.data(), next.size(), MSG_NOSIGNAL);
        if (count < 0) {
            if (errno != EAGAIN && errno != EINTR) client.go(std::strerror(errno));
            return;
        }
        client.outgoing.sent(static_cast<std::size_t>(count));
        left -= static_cast<std::size_t>(count);
    }
}

void Hub::judge(Client& client, Clock::time_point now) {
    const double seconds = std::chrono::duration<double>(now - client.began).count();
    const double allowed =
        options_.limits.silence_s + double(client.incoming.promised_bytes()) / least_bytes_per_second;
    if (client.half_closed && seconds > options_.limits.silence_s) client.go("it had closed its end");
    if (client.incoming.within_message() && seconds > allowed)
        client.go(fmt::format("a message was not complete after {:.0f} s", seconds));
    if (client.outgoing.waiting() > options_.limits.waiting_messages)
        client.go(fmt::format("it did not read {} messages", client.outgoing.waiting()));
}

void Hub::remove_gone(Session& session) {
    for (auto at = clients_.begin(); at != clients_.end();) {
        if (at->second.gone.empty()) {
            ++at;
            continue;
        }
        note_(fmt::format("client {} is let go: {}", at->first, at->second.gone));
        session.left(at->first);
        at = clients_.erase(at);
    }
}

void Hub::run(Session& session, const std::function<bool()>& should_stop) {
    while (!should_stop()) {
        std::vector<pollfd> polled{{listener_, POLLIN, 0}, {wake_, POLLIN, 0}};
        std::vector<Client*> order;
        for (auto& [id, client] : clients_) {
            short events = 0;
            if (may_read(client, session)) events |= POLLIN;
            if (client.outgoing.waiting() > 0) events |= POLLOUT;
            polled.push_back({client.file, events, 0});
            order.push_back(&client);
        }
        constexpr int wait_ms = 200;
        if (::poll(polled.data(), polled.size(), wait_ms) < 0 && errno != EINTR) continue;
        if (polled[1].revents) take_posts();
        const Clock::time_point now = Clock::now();
        for (std::size_t n = 0; n < order.size(); ++n) {
            const short events = polled[n + 2].revents;
            if (events & POLLIN) read_from(*order[n], session);
            if (events & POLLOUT) write_to(*order[n]);
            if (events & (POLLERR | POLLNVAL)) order[n]->go("the connection broke");
            if ((events & POLLHUP) && !(events & POLLIN)) order[n]->go("it left");
            judge(*order[n], now);
        }
        remove_gone(session);
        if (polled[0].revents) accept_clients(session);
    }
}

}  // namespace tissuewarp::server
