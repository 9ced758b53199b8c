#pragma once
/// Clients on one port: one thread listens, reads and writes, and waits for none of them.

#include "server/incoming.hpp"
#include "server/outgoing.hpp"
#include "server/session.hpp"

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>

namespace tissuewarp::server {

struct HubOptions {
    std::string address = "127.0.0.1";  ///< a number of IPv4 or IPv6
    int port = 18944;                   ///< 0: any that is free
    Limits limits;
};

class Hub final : public Outbox {
public:
    using Note = std::function<void(const std::string&)>;

    /// Listens. Throws IoError where it cannot, InvalidInput for an address that is none.
    Hub(const HubOptions& options, Note note);
    ~Hub() override;
    Hub(const Hub&) = delete;
    Hub& operator=(const Hub&) = delete;

    [[nodiscard]] int port() const { return port_; }

    /// Carries messages until `should_stop` says so, which is asked five times a second.
    void run(Session& session, const std::function<bool()>& should_stop);

    void send(std::uint32_t client, const Parcel& parcel) override;
    void show(const Parcel& parcel, std::uint32_t except = 0) override;
    void drop(std::uint32_t client, const std::string& why) override;
    void note(const std::string& text) override;

private:
    using Clock = std::chrono::steady_clock;
    struct Client;

    void accept_clients(Session& session);
    void remove_half_closed(Session& session);
    void take_posts();
    void read_from(Client& client, Session& session);
    void write_to(Client& client);
    void judge(Client& client, Clock::time_point now);
    void remove_gone(Session& session);
    [[nodiscard]] bool may_read(Client& client, const Session& session) const;

    /// What other threads want to be sent.
    struct Post {
        std::uint32_t client = 0, except = 0;  ///< client 0: to all
        Parcel parcel;
        std::string drop;  ///< why the client is to go
    };
    void post(Post post);

    HubOptions options_;
    Note note_;
    int listener_ = -1, wake_ = -1, port_ = 0;
    std::map<std::uint32_t, Client> clients_;
    std::uint32_t last_client_ = 0;
    std::map<std::string, Parcel> newest_;  // of what is shown, by key
    std::vector<std::string> shown_order_;  // its keys, the newest last

    std::mutex mutex_;  // of what follows
    std::vector<Post> posts_;
};

}  // namespace tissuewarp::server
