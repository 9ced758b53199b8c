/// Updates that follow from messages: what is said of them, which are answered, and that the log gives the same bits.
#include "server/session.hpp"
#include "server/answers.hpp"
#include "server/recall.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/server/block.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <condition_variable>
#include <mutex>

namespace tissuewarp::server {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

struct Got {
    std::string type, device;
    Message message;
    Bytes bytes;
    double seconds = 0;  ///< when, as its header has it
};

/// Keeps what is sent, and may hold whoever sends it.
class Kept final : public Outbox {
public:
    void send(std::uint32_t, const Parcel& parcel) override { keep(parcel); }
    void show(const Parcel& parcel, std::uint32_t) override {
        keep(parcel);
        std::unique_lock lock(mutex_);
        const Message& message = got_.back().message;
        if (const auto* status = std::get_if<Status>(&message); status && status->code == gate_) {
            at_gate_ = true;
            changed_.notify_all();
            changed_.wait(lock, [&] { return gate_ == 0; });
        }
    }
    void drop(std::uint32_t client, const std::string&) override {
        const std::scoped_lock lock(mutex_);
        dropped.push_back(client);
    }
    void note(const std::string& text) override {
        const std::scoped_lock lock(mutex_);
        notes.push_back(text);
    }

    /// From now on whoever shows a status of this code waits: an update before it computes, or at 2 the thread that
    /// takes messages in when it refuses one.
    void close_gate(int code = 6) {
        const std::scoped_lock lock(mutex_);
        gate_ = code;
        at_gate_ = false;
    }
    void wait_at_gate() {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::seconds(60), [&] { return at_gate_; });
    }
    void open_gate() {
        const std::scoped_lock lock(mutex_);
        gate_ = 0;
        changed_.notify_all();
    }

    /// The answer to a request.
    json answer(int sequence) {
        json found;
        wait([&](const Got& got) {
            const auto* text = std::get_if<Text>(&got.message);
            if (!text) return false;
            found = json::parse(text->text);
            return found.at("sequence") == sequence;
        });
        return found;
    }
    Got shown(const std::string& device) {
        return wait([&](const Got& got) { return got.device == device; });
    }
    std::vector<std::string> order() {
        const std::scoped_lock lock(mutex_);
        std::vector<std::string> types;
        for (const Got& got : got_) types.push_back(got.type);
        return types;
    }

    std::vector<std::uint32_t> dropped;
    std::vector<std::string> notes;

private:
    void keep(const Parcel& parcel) {
        for (const std::shared_ptr<const Bytes>& bytes : parcel.messages) keep(*bytes);
    }
    void keep(const Bytes& bytes) {
        const Header header = parse_header(ByteView(bytes).first(header_bytes), {.text_bytes = 1 << 17});
        Frame frame{header, {bytes.begin() + header_bytes, bytes.end()}};
        const std::scoped_lock lock(mutex_);
        got_.push_back({header.type, header.device, decode(frame), frame.body, seconds_of(header)});
        changed_.notify_all();
    }
    template <class Is>
    Got wait(const Is& is) {
        std::unique_lock lock(mutex_);
        Got found;
        const bool came = changed_.wait_for(lock, std::chrono::seconds(60), [&] {
            for (const Got& got : got_)
                if (is(got)) {
                    found = got;
                    return true;
                }
            return false;
        });
        EXPECT_TRUE(came) << "nothing of this kind was sent";
        return found;
    }

    std::mutex mutex_;
    std::condition_variable changed_;
    std::vector<Got> got_;
    int gate_ = 0;
    bool at_gate_ = false;
};

Frame frame(const char* type, const char* device, Bytes body) {
    return {{1, type, device, 0, body.size(), 0}, std::move(body)};
}

Frame request(const json& object) {
    return frame("STRING", "request", encode(Text{object.dump()}));
}

/// Places of the block, and where they are seen `shift` mm further and stretched.
void send_pairs(Session& session, double shift) {
    NamedPoints moving, fixed;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k) {
                const Eigen::Vector3d place(5 + 15 * i, 5 + 15 * j, 5 + 15 * k);
                const std::string name = std::to_string(9 * i + 3 * j + k);
                moving.push_back({name, "", place});
                fixed.push_back({name, "", place + Eigen::Vector3d(shift, 0, 0.05 * place.z())});
            }
    session.receive(1, frame("POINT", "moving_points", encode(moving)));
    session.receive(1, frame("POINT", "fixed_points", encode(fixed)));
}

json update(int sequence) {
    return {{"do", "update"}, {"sequence", sequence}, {"points_sd_mm", 0.3}, {"rounds", 2}};
}

TEST(Session, AnUpdateTellsItsStateBeforeItsOrgan) {
    Kept kept;
    Session session(test::block(), {}, kept);
    send_pairs(session, 4);
    session.receive(1, frame("POINT", "targets", encode(NamedPoints{{"tumour", "", {20, 20, 40}}})));
    session.receive(1, request(update(7)));
    const json answer = kept.answer(7);
    EXPECT_EQ(answer.at("status"), "ok") << answer;
    EXPECT_EQ(answer.at("state"), 3);
    EXPECT_EQ(answer.at("outdated"), false);
    EXPECT_GT(answer.at("seconds").at("total"), 0);
    const auto organ = std::get<PolyData>(kept.shown("organ").message);
    EXPECT_EQ(organ.points.cols(), 152);  // nodes of the surface of 5 × 5 × 5 cubes
    EXPECT_NEAR(organ.points.row(0).minCoeff(), 4, 0.5);
    EXPECT_NEAR(organ.points.row(2).maxCoeff(), 42, 0.5);
    const auto targets = std::get<NamedPoints>(kept.shown("targets_now").message);
    EXPECT_LT((targets[0].position - Eigen::Vector3d(24, 20, 42)).norm(), 0.7);
    EXPECT_THAT(targets[0].group, HasSubstr("95 %"));
    for (const char* device : {"organ", "targets_now"})
        EXPECT_NEAR(kept.shown(device).seconds, answer.at("time").get<double>(), 1e-6) << device;
    EXPECT_NEAR(answer.at("time").get<double>(), now_s(), 60);
    for (const char* stage : {"equilibrium", "error estimate", "organ and targets"})
        EXPECT_GT(answer.at("seconds").at(stage), 0) << stage;
    const std::vector<std::string> order = kept.order();
    const auto place = [&](const char* type) { return std::find(order.begin(), order.end(), type) - order.begin(); };
    EXPECT_LT(place("STRING"), place("POLYDATA"));
}

TEST(Session, AnAnswerOfAnOlderStateSaysSo) {
    Kept kept;
    Session session(test::block(), {}, kept);
    send_pairs(session, 4);
    kept.close_gate();
    session.receive(1, request(update(1)));
    kept.wait_at_gate();
    send_pairs(session, 6);
    session.receive(1, request({{"do", "info"}, {"sequence", 2}}));
    kept.answer(2);
    kept.open_gate();
    const json answer = kept.answer(1);
    EXPECT_EQ(answer.at("state"), 2);
    EXPECT_EQ(answer.at("newest_state"), 4);
    EXPECT_EQ(answer.at("outdated"), true);
}

TEST(Session, ANewerRequestTakesThePlaceOfAnOlder) {
    Kept kept;
    Session session(test::block(), {}, kept);
    send_pairs(session, 4);
    kept.close_gate();
    session.receive(1, request(update(1)));
    kept.wait_at_gate();
    session.receive(2, request(update(2)));
    session.receive(2, request(update(3)));
    session.receive(1, request({{"do", "info"}, {"sequence", 4}}));
    kept.answer(4);
    kept.open_gate();
    EXPECT_EQ(kept.answer(1).at("status"), "cancelled");
    EXPECT_EQ(kept.answer(2).at("status"), "superseded");
    EXPECT_EQ(kept.answer(3).at("status"), "ok");
}

TEST(Session, OfAClientThatLeftOnlyUpdatesAreDropped) {
    Kept kept;
    Session session(test::block(), {}, kept);
    json follow = update(1);
    follow["do"] = "follow";
    session.receive(1, request(follow));
    kept.answer(1);
    kept.close_gate(2);
    session.receive(2, request(update(2)));  // there are no data yet: it is refused
    kept.wait_at_gate();
    session.receive(1, request({{"do", "stop"}, {"sequence", 3}}));
    send_pairs(session, 4);
    session.receive(1, request(update(4)));
    session.left(1);
    session.receive(2, request(update(5)));
    kept.open_gate();
    EXPECT_EQ(kept.answer(5).at("update"), 1);
}

TEST(Session, UpdatesFollowTheData) {
    Kept kept;
    Session session(test::block(), {}, kept);
    json follow = update(1);
    follow["do"] = "follow";
    session.receive(1, request(follow));
    send_pairs(session, 4);
    const auto organ = std::get<PolyData>(kept.shown("organ").message);
    EXPECT_NEAR(organ.points.row(0).minCoeff(), 4, 0.5);
}

TEST(Session, WhatCannotBeRegisteredIsSaid) {
    Kept kept;
    Session session(test::block(), {}, kept);
    session.receive(1, request(update(1)));
    EXPECT_THAT(kept.answer(1).at("why"), HasSubstr("send data first"));
    imaging::Volume image(registration::test::plain_grid({20, 20, 20}), CV_16SC1);
    session.receive(1, frame("IMAGE", "fixed", encode(image)));
    session.receive(1, request(update(2)));
    const json answer = kept.answer(2);
    EXPECT_EQ(answer.at("status"), "failed");
    EXPECT_THAT(answer.at("why"), HasSubstr("image"));
    EXPECT_TRUE(kept.dropped.empty());
}

TEST(Session, WhoSendsNoMessagesIsLetGo) {
    Kept kept;
    Session session(test::block(), {}, kept);
    session.receive(3, frame("POINT", "targets", Bytes(135)));
    session.receive(1, request({{"do", "info"}, {"sequence", 1}}));
    kept.answer(1);
    EXPECT_EQ(kept.dropped, std::vector<std::uint32_t>{3});
}

TEST(Session, UpdatesGoOnFromTheLastUnlessToldOtherwise) {
    Kept kept;
    Session session(test::block(), {}, kept);
    send_pairs(session, 4);
    session.receive(1, request(update(1)));
    EXPECT_EQ(kept.answer(1).at("began").at("at_last"), false);
    send_pairs(session, 4.5);
    session.receive(1, request(update(2)));
    EXPECT_EQ(kept.answer(2).at("began").at("at_last"), true);
    json anew = update(3);
    anew["begin_anew"] = true;
    session.receive(1, request(anew));
    EXPECT_EQ(kept.answer(3).at("began").at("at_last"), false);
    send_pairs(session, 30);
    session.receive(1, request(update(4)));
    EXPECT_THAT(kept.answer(4).at("began").at("why_not"), HasSubstr("moved"));
    json other = update(5);
    other["align"] = false;
    session.receive(1, request(other));
    EXPECT_EQ(kept.answer(5).at("began").at("at_last"), false);
}

/// Pairs at one end of a long bar do not tell where the rest lies, which the error estimate alone says.
TEST(Session, AnUpdateWhoseErrorsAreDoubtedIsMadeAnew) {
    Kept kept;
    Session session(test::block(240), {}, kept);
    const auto ask = [&](int number, double shift, bool with_errors) {
        send_pairs(session, shift);
        json wanted = update(number);
        wanted["error_estimate"] = with_errors;
        session.receive(1, request(wanted));
        return kept.answer(number);
    };
    EXPECT_EQ(ask(1, 4, false).at("doubts"), json::array());
    EXPECT_EQ(ask(2, 4.5, false).at("began").at("at_last"), true);
    const json answer = ask(3, 4.5, true);
    EXPECT_EQ(answer.at("began").at("at_last"), false) << answer;
    EXPECT_EQ(answer.at("began").at("why_not"), "its errors were doubted");
    EXPECT_GT(answer.at("seconds").value("going on in vain", 0.0), 0);
    EXPECT_NE(answer.at("doubts"), json::array());
}

/// Nobody computes on a GPU that is not there.
TEST(Session, AServerStartsWhoseLogCannotBeComputedAgain) {
    const tissuewarp::test::TemporaryFolder folder;
    const SessionOptions options{{}, folder / "log", {}};
    ServedPatient patient = test::block();
    {
        Kept kept;
        Session session(patient, options, kept);
        send_pairs(session, 4);
        session.receive(1, request(update(1)));
        EXPECT_EQ(kept.answer(1).at("status"), "ok");
    }
    patient.update.device = registration::Device::Gpu;
    patient.update.gpu_index = 99;
    {
        Kept kept;
        Session session(patient, options, kept);
        session.receive(1, request({{"do", "info"}, {"sequence", 2}}));
        EXPECT_THAT(kept.answer(2).at("why"), HasSubstr("fixed_points"));
        EXPECT_THAT(kept.notes, ::testing::Contains(HasSubstr("cannot be computed again")));
        session.receive(1, request(update(3)));
        EXPECT_EQ(kept.answer(3).at("status"), "failed");
    }
    patient.update = test::block().update;
    Kept kept;
    Session session(patient, options, kept);
    session.receive(1, request(update(4)));
    EXPECT_EQ(kept.answer(4).at("status"), "ok");
}

TEST(Session, ALogGoesOnWithTheSameBits) {
    const tissuewarp::test::TemporaryFolder folder;
    const SessionOptions options{{}, folder / "log", {}};
    const ServedPatient patient = test::block();
    const auto ask = [&](Session& session, Kept& kept, int number, double shift) {
        send_pairs(session, shift);
        session.receive(1, request(update(number)));
        return kept.answer(number);
    };
    json third;
    {
        Kept kept;
        Session session(patient, options, kept);
        for (int n = 1; n <= 2; ++n) ask(session, kept, n, 4 + 0.5 * n);
        third = ask(session, kept, 3, 5.5);
        EXPECT_EQ(third.at("began").at("at_last"), true);
    }
    {
        Kept kept;
        Session session(patient, options, kept);
        EXPECT_EQ(kept.answer(0).at("digest"), third.at("digest"));
        EXPECT_EQ(ask(session, kept, 4, 6).at("began").at("at_last"), true);
        session.receive(1, request({{"do", "info"}, {"sequence", 5}}));
        EXPECT_THAT(kept.answer(5).at("why"), HasSubstr("state 8"));
    }
    int updates = 0;
    replay(patient, {}, options.log, [&](long long number, bool same) {
        EXPECT_TRUE(same) << number;
        ++updates;
    });
    EXPECT_EQ(updates, 4);
}

/// A stylus is drawn over the side of the block that lies at x = 44 now, to and fro.
void draw_stylus(Session& session, double seconds) {
    for (int i = 0; i <= 18; ++i)
        for (int j = 0; j <= 18; ++j) {
            const Eigen::Vector3d place(44, 2 + 2 * (i % 2 ? 18 - j : j), 2 + 2 * i);
            Frame passed = frame("TRANSFORM", "stylus", encode(Eigen::Isometry3d(Eigen::Translation3d(place))));
            passed.header.timestamp = static_cast<std::uint64_t>((seconds + 0.02 * (19 * i + j)) * 4294967296.0);
            session.receive(1, std::move(passed));
        }
}

TEST(Session, WhatAStylusTouchesIsRegisteredToAndReplayed) {
    const tissuewarp::test::TemporaryFolder folder;
    const SessionOptions options{{}, folder / "log", {}};
    const ServedPatient patient = test::block();
    {
        Kept kept;
        Session session(patient, options, kept);
        session.receive(1, request({{"do", "gather"}, {"sequence", 1}, {"id", "side"}, {"spacing_mm", 1.5}}));
        EXPECT_EQ(kept.answer(1).at("status"), "ok");
        draw_stylus(session, 1000);
        json side = update(2);
        side["align"] = false;
        session.receive(1, request(side));
        EXPECT_EQ(kept.answer(2).at("state"), 361);
        const auto organ = std::get<PolyData>(kept.shown("organ").message);
        EXPECT_NEAR(organ.points.row(0).maxCoeff(), 44, 0.3);
        draw_stylus(session, 1000.5);  // says nothing new
        session.receive(1, request({{"do", "info"}, {"sequence", 3}}));
        EXPECT_THAT(kept.answer(3).at("why"), HasSubstr("state 361, data: touched; points touched: 361"));
        session.receive(1, request({{"do", "pause"}, {"sequence", 4}}));
        session.receive(1, request({{"do", "forget"}, {"sequence", 5}, {"ids", {"side"}}}));
        session.receive(1, request(update(6)));
        EXPECT_THAT(kept.answer(6).at("why"), HasSubstr("nothing to register"));
    }
    int updates = 0;
    replay(patient, {}, options.log, [&](long long, bool same) {
        EXPECT_TRUE(same);
        ++updates;
    });
    EXPECT_EQ(updates, 1);
}

Products doubted() {
    Products products;
    products.result.deformation =
        registration::test::deformed_by(registration::test::box_at({0, 0, 0}, {10, 10, 10}, {1, 1, 1}),
                                        [](const Eigen::Vector3d&) { return Eigen::Vector3d::Zero(); });
    products.result.doubts.push_back({"surface.off", 1, 0, "it lies elsewhere"});
    return products;
}

TEST(Answers, AfterADoubtEveryMessageSaysSo) {
    const Products products = doubted();
    const json text = json::parse(answer({}, products, 0, 0, {}));
    EXPECT_EQ(text.at("status"), "doubted");
    EXPECT_EQ(text.at("doubts").at(0).at("code"), "surface.off");
    const Status status = status_of({}, products, 0);
    EXPECT_NE(status.code, 1);
    EXPECT_THAT(status.text, HasSubstr("surface.off"));
    const PolyData organ = organ_of(products);
    ASSERT_EQ(organ.point_arrays.back().name, "doubted");
    EXPECT_EQ(organ.point_arrays.back().values.minCoeff(), 1);
    EXPECT_EQ(targets_of(products, {{"t", "", {5, 5, 5}}}, 60)[0].group, "doubted");
}

TEST(Answers, WhatGaveNoResultLeavesAnOlderOne) {
    Job job;
    job.state = 5;
    const Status status = status_of_failure(job, "no equilibrium");
    EXPECT_NE(status.code, 1);
    EXPECT_THAT(status.text, HasSubstr("older"));
}

}  // namespace
}  // namespace tissuewarp::server
