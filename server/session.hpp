#pragma once
/// A patient, what clients said of the operation, and the updates that follow from it. One thread takes messages in,
/// one computes; whoever carries bytes waits for neither.

#include "server/computation.hpp"
#include "server/journal.hpp"
#include "server/outgoing.hpp"
#include "server/scene.hpp"

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

namespace tissuewarp::server {

/// Where messages go. Called from any thread.
class Outbox {
public:
    virtual ~Outbox() = default;
    /// To one client, if it is still there.
    virtual void send(std::uint32_t client, const Parcel& parcel) = 0;
    /// To all but one, and to those who come later.
    virtual void show(const Parcel& parcel, std::uint32_t except = 0) = 0;
    /// Ends a connection.
    virtual void drop(std::uint32_t client, const std::string& why) = 0;
    /// One line for the operator.
    virtual void note(const std::string& text) = 0;
};

struct SessionOptions {
    std::filesystem::path folder;  ///< where requests may read and write; empty: nowhere
    std::filesystem::path log;     ///< or empty
    NamedPoints targets;           ///< carried along until a client sends others
};

class Session {
public:
    /// Goes on where the log ends. Throws IoError, InvalidInput.
    Session(ServedPatient patient, SessionOptions options, Outbox& outbox);
    /// Ends the update that runs.
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    /// A message of a client; clients are counted from 1.
    void receive(std::uint32_t client, Frame frame);
    /// A client has gone: updates that it asked for are not begun; whatever else it said holds.
    void left(std::uint32_t client);
    /// Of messages that wait to be taken in.
    [[nodiscard]] std::uint64_t waiting_bytes() const { return waiting_bytes_; }

private:
    struct Received {
        std::uint32_t client = 0;
        Frame frame;
        bool sender_left = false;
    };
    struct Running;

    void take_messages();
    void take(const Received& received);
    void take_in(const Received& received, const Message& message);
    void follow();
    void obey(const Received& received, const std::string& text);
    void touch_file(const Received& received, const Request& request);
    void remember(const Received& received);
    void begin(std::uint32_t client, const Request& request, const std::string& text, bool follows);
    void cancel(const std::string& why);
    void compute_jobs();
    void finish(const Job& job, Products made, const std::vector<std::string>& notes);
    void tell(const Job& job, const Products& products, const std::vector<std::string>& notes);
    void refuse(std::uint32_t client, const Request& request, const std::string& status, const std::string& why);
    void go_on();
    void log(Entry::Kind kind, std::uint32_t client, ByteView payload);

    const ServedPatient patient_;
    const SessionOptions options_;
    Outbox& outbox_;
    std::unique_ptr<Journal> journal_;
    std::atomic<bool> log_broke_ = false;

    // Of the thread that takes messages in.
    Scene scene_;
    std::optional<std::pair<Request, std::string>> follow_;
    std::uint32_t follower_ = 0;
    long long updates_ = 0;

    std::mutex mutex_;  // of what follows
    std::condition_variable arrived_, wanted_;
    std::deque<Received> inbox_;
    std::optional<Job> next_;
    std::shared_ptr<Running> running_;
    std::shared_ptr<const Products> last_;  // that gave a result: the next update goes on from it
    bool ending_ = false;
    std::atomic<long long> newest_state_ = 0;
    std::atomic<std::uint64_t> waiting_bytes_ = 0;

    std::thread taking_, computing_;
};

}  // namespace tissuewarp::server
