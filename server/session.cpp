#include "server/session.hpp"

#include "server/answers.hpp"
#include "server/recall.hpp"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace tissuewarp::server {

/// The update that is being computed.
struct Session::Running final : Observer {
    explicit Running(Job given) : job(std::move(given)) {}
    bool cancel_requested() override { return cancelled; }
    void note(std::string_view message) override { notes.emplace_back(message); }

    Job job;
    std::atomic<bool> cancelled = false;
    std::string why;
    std::vector<std::string> notes;
};

Session::Session(ServedPatient patient, SessionOptions options, Outbox& outbox)
    : patient_(std::move(patient)), options_(std::move(options)), outbox_(outbox) {
    scene_.set_targets(options_.targets);
    if (!options_.log.empty()) journal_ = std::make_unique<Journal>(options_.log, patient_.digest);
    outbox_.show(shown({1, "", "ready; nothing was seen yet"}));
    if (journal_) go_on();
    taking_ = std::thread([this] { take_messages(); });
    // Work that asks for the concurrency hears of the limit of whoever makes the session; a thread begins without one.
    const int threads = tbb::this_task_arena::max_concurrency();
    computing_ = std::thread([this, threads] { tbb::task_arena(threads).execute([this] { compute_jobs(); }); });
}

Session::~Session() {
    {
        const std::scoped_lock lock(mutex_);
        ending_ = true;
        if (running_) running_->cancelled = true;
    }
    arrived_.notify_all();
    wanted_.notify_all();
    taking_.join();
    computing_.join();
}

/// The scene as the log leaves it, what updates go on from, and the last update once more.
void Session::go_on() {
    const LoggedResults results = logged_results(options_.log, patient_.digest);
    Recalled recalled{std::move(scene_), {}};
    std::optional<Job> last;
    read_journal(options_.log, patient_.digest, [&](const Entry& entry) {
        recalled.take(entry);
        if (entry.kind == Entry::Kind::Update) last = recalled.job(entry);
    });
    scene_ = std::move(recalled.scene);
    follow_ = std::move(recalled.follow);
    newest_state_ = scene_.state();
    if (!last) return;
    updates_ = last->number;
    outbox_.note(fmt::format("the log goes to state {}; update {} is computed again", scene_.state(), last->number));
    try {
        compute_again(patient_, options_.targets, options_.log, results, results.begin_of_last,
                      [&](const Job&, const std::shared_ptr<const Products>& products) { last_ = products; });
    } catch (const Error& problem) {  // another device, say: the next update begins anew
        last_.reset();
        outbox_.note(fmt::format("what the log's updates gave cannot be computed again: {}", problem.what()));
    }
    if (last_ && results.last == last->number)
        tell(*last, *last_, {});
    else
        next_ = std::move(last);
}

void Session::receive(std::uint32_t client, Frame frame) {
    waiting_bytes_ += frame.body.size();
    {
        const std::scoped_lock lock(mutex_);
        inbox_.push_back({client, std::move(frame), false});
    }
    arrived_.notify_one();
}

void Session::left(std::uint32_t client) {
    const std::scoped_lock lock(mutex_);
    for (Received& received : inbox_)
        if (received.client == client) received.sender_left = true;
}

void Session::take_messages() {
    while (true) {
        Received received;
        {
            std::unique_lock lock(mutex_);
            arrived_.wait(lock, [&] { return ending_ || !inbox_.empty(); });
            if (ending_) return;
            received = std::move(inbox_.front());
            inbox_.pop_front();
        }
        const std::uint64_t bytes = received.frame.body.size();
        take(received);
        waiting_bytes_ -= bytes;
    }
}

void Session::take(const Received& received) {
    try {
        const Message message = decode(received.frame);
        if (const auto* text = std::get_if<Text>(&message)) return obey(received, text->text);
        take_in(received, message);
    } catch (const BadMessage& problem) {
        outbox_.drop(received.client, problem.what());
    } catch (const std::exception& problem) {  // whatever one message did, the next is heard
        refuse(received.client, {}, "refused", received.frame.header.device + ": " + problem.what());
    }
}

void Session::take_in(const Received& received, const Message& message) {
    const long long before = scene_.state();
    scene_.take(received.frame.header.device, message, seconds_of(received.frame.header));
    if (scene_.state() == before) return;
    remember(received);
    follow();
}

/// The scene has changed.
void Session::follow() {
    newest_state_ = scene_.state();
    if (follow_ && !scene_.data().empty()) begin(follower_, follow_->first, follow_->second, true);
}

void Session::remember(const Received& received) {
    log(Entry::Kind::Taken, received.client, logged(received.frame));
}

/// A log that cannot be written is no log: the server says so, and goes on without one.
void Session::log(Entry::Kind kind, std::uint32_t client, ByteView payload) {
    if (!journal_ || log_broke_) return;
    try {
        journal_->append(kind, client, payload);
    } catch (const IoError& problem) {
        log_broke_ = true;
        outbox_.note(fmt::format("{}; nothing is logged from here on", problem.what()));
    }
}

void Session::refuse(std::uint32_t client, const Request& request, const std::string& status, const std::string& why) {
    if (client > 0) outbox_.send(client, said(answer(request, status, why)));
}

void Session::obey(const Received& received, const std::string& text) {
    Request request;
    try {
        request = parse_request(text);
        switch (request.what) {
            case Request::Do::Update:
                if (received.sender_left) return;
                return begin(received.client, request, text, false);
            case Request::Do::Follow:
                follow_ = {request, text};
                follower_ = received.client;
                remember(received);
                if (!scene_.data().empty()) begin(follower_, request, text, true);
                return refuse(received.client, request, "ok", "updates follow the data from here on");
            case Request::Do::Stop:
                follow_.reset();
                remember(received);
                return refuse(received.client, request, "ok", "updates wait for requests");
            case Request::Do::Cancel:
                cancel("another request cancelled it");
                return refuse(received.client, request, "ok", "what was running is cancelled");
            case Request::Do::Gather:
            case Request::Do::Pause:
                apply(request, scene_);
                remember(received);
                return refuse(received.client, request, "ok",
                              request.what == Request::Do::Gather
                                  ? fmt::format("what '{}' touches is gathered from here on", request.gathering.device)
                                  : "touches are not gathered from here on");
            case Request::Do::Forget:
                apply(request, scene_);
                remember(received);
                follow();
                return refuse(received.client, request, "ok", fmt::format("state {}", scene_.state()));
            case Request::Do::Info:
                return refuse(received.client, request, "ok",
                              fmt::format("state {}, data: {}; points touched: {}", scene_.state(),
                                          fmt::join(scene_.data(), ", "), scene_.touched().size()));
            case Request::Do::Load:
            case Request::Do::Save:
                return touch_file(received, request);
        }
    } catch (const Error& problem) {
        refuse(received.client, request, "refused", problem.what());
    }
}

void Session::begin(std::uint32_t client, const Request& request, const std::string& text, bool follows) {
    Job job;
    try {
        job = job_of(scene_, request, text);
        if (scene_.data().empty()) throw InvalidInput("there is nothing to register to yet; send data first");
    } catch (const InvalidInput& problem) {
        outbox_.show(shown({2, "refused", problem.what()}));
        return refuse(client, request, "refused", problem.what());
    }
    job.number = ++updates_;
    job.client = client;
    job.follows = follows;
    log(Entry::Kind::Update, client, logged(job));
    std::optional<Job> superseded;
    {
        const std::scoped_lock lock(mutex_);
        superseded = std::exchange(next_, std::move(job));
        // Data that stream in must not keep every update from its end; a request may.
        if (running_ && !follows) {
            running_->why = "a newer request took its place";
            running_->cancelled = true;
        }
    }
    if (superseded && !superseded->follows)
        refuse(superseded->client, superseded->request, "superseded", "a newer one took its place");
    wanted_.notify_one();
}

void Session::cancel(const std::string& why) {
    std::optional<Job> dropped;
    {
        const std::scoped_lock lock(mutex_);
        dropped = std::exchange(next_, std::nullopt);
        if (running_) {
            running_->why = why;
            running_->cancelled = true;
        }
    }
    if (dropped) refuse(dropped->client, dropped->request, "cancelled", why);
}

void Session::compute_jobs() {
    Computer computer(patient_);
    while (true) {
        std::shared_ptr<Running> running;
        std::shared_ptr<const Products> before;
        {
            std::unique_lock lock(mutex_);
            running_.reset();
            wanted_.wait(lock, [&] { return ending_ || next_; });
            if (ending_) return;
            running = running_ = std::make_shared<Running>(std::move(*next_));
            next_.reset();
            before = last_;
        }
        const Job& job = running->job;
        outbox_.show(shown({6, "busy", fmt::format("update {} of state {}", job.number, job.state)}));
        const auto fail = [&](const std::string& status, const std::string& why) {
            outbox_.show(shown(status_of_failure(job, why)));
            refuse(job.client, job.request, status, why);
        };
        try {
            Products products = computer.compute(job, before.get(), *running);
            if (running->cancelled) throw Cancelled();
            finish(job, std::move(products), running->notes);
        } catch (const Cancelled&) {
            std::unique_lock lock(mutex_);
            const std::string why = running->why;
            lock.unlock();
            fail("cancelled", why);
        } catch (const std::exception& problem) {  // whatever happened to one update, the next may succeed
            fail("failed", problem.what());
        }
    }
}

void Session::finish(const Job& job, Products made, const std::vector<std::string>& notes) {
    const auto products = std::make_shared<const Products>(std::move(made));
    {
        const std::scoped_lock lock(mutex_);
        last_ = products;  // before the answer, after which it may be asked for
    }
    log(Entry::Kind::Result, job.client, logged(job, *products));
    tell(job, *products, notes);
}

/// What it is worth is said before it is shown.
void Session::tell(const Job& job, const Products& products, const std::vector<std::string>& notes) {
    const long long newest = newest_state_;
    const double time = products.time_s;
    outbox_.show(shown(status_of(job, products, newest), time));
    const Parcel organ = parcel("update", "POLYDATA", "organ", encode(products.organ), time);
    const Parcel targets = parcel("update", "POINT", "targets_now", encode(products.targets), time);
    const auto update = [&](long long sequence) {
        Parcel all{"update", said(answer(job, products, sequence, newest, notes), time).messages};
        all.messages.push_back(organ.messages.front());
        if (!products.targets.empty()) all.messages.push_back(targets.messages.front());
        return all;
    };
    if (job.client > 0) {
        Parcel asked_for = update(job.request.sequence);
        asked_for.answers = true;
        outbox_.send(job.client, asked_for);
    }
    outbox_.show(update(0), job.client);
    const auto send_image = [&](const char* name, const imaging::Volume& image) {
        if (!image.empty()) outbox_.send(job.client, parcel(name, "IMAGE", name, encode(image), time));
    };
    if (job.client == 0) return;
    send_image("warped", products.warped);
    send_image("field", products.field);
}

}  // namespace tissuewarp::server
