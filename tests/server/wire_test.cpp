/// Frames: the checksum, limits before memory, both versions of the header, whatever pieces the bytes come in.
#include "server/crc64.hpp"
#include "server/incoming.hpp"
#include "server/outgoing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

namespace tissuewarp::server {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Bytes bytes_of(std::string_view text) {
    return {text.begin(), text.end()};
}

/// One bit at a time, as the polynomial says.
std::uint64_t slow_crc(ByteView bytes) {
    std::uint64_t crc = 0;
    for (const unsigned char byte : bytes) {
        crc ^= std::uint64_t{byte} << 56;
        for (int bit = 0; bit < 8; ++bit) crc = (crc << 1) ^ ((crc >> 63) ? 0x42F0E1EBA9EA3693ull : 0);
    }
    return crc;
}

TEST(Crc, IsThatOfEcma182) {
    EXPECT_EQ(crc64(bytes_of("123456789")), 0x6C40DF5F0B497347ull);  // the check value of CRC-64/ECMA-182
}

TEST(Crc, EightBytesAtATimeAreTheSame) {
    std::mt19937 random(1);
    Bytes bytes(1000);
    for (unsigned char& byte : bytes) byte = static_cast<unsigned char>(random());
    for (const std::size_t split : {0u, 1u, 7u, 8u, 513u, 1000u})
        EXPECT_EQ(crc64(ByteView(bytes).subspan(split), crc64(ByteView(bytes).first(split))), slow_crc(bytes));
}

Bytes text_message(std::string_view text) {
    Writer writer;
    writer.u16(3);
    writer.u16(static_cast<std::uint16_t>(text.size()));
    writer.text(text, text.size());
    return framed("STRING", "a device", writer.bytes());
}

TEST(Incoming, PiecesOfAnySize) {
    Bytes stream;
    for (const char* text : {"one", "", "three"}) {
        const Bytes message = text_message(text);
        stream.insert(stream.end(), message.begin(), message.end());
    }
    const Limits limits;
    for (std::size_t size = 1; size < 200; size += 13) {
        Incoming incoming(limits);
        std::vector<Frame> frames;
        for (std::size_t at = 0; at < stream.size(); at += size)
            for (Frame& frame : incoming.feed(ByteView(stream).subspan(at, std::min(size, stream.size() - at))))
                frames.push_back(std::move(frame));
        ASSERT_EQ(frames.size(), 3u) << size;
        EXPECT_EQ(frames[2].header.device, "a device");
        EXPECT_EQ(frames[2].body.size(), 9u);
        EXPECT_FALSE(incoming.within_message());
    }
}

TEST(Incoming, PassesOverWhatItDoesNotKnow) {
    const Limits limits;
    Incoming incoming(limits);
    EXPECT_TRUE(incoming.feed(framed("TDATA", "tracker", Bytes(5000, 1))).empty());
    EXPECT_EQ(incoming.feed(text_message("x")).size(), 1u);
}

/// What a header promises, with this many bytes of body.
Bytes promise(std::string_view type, std::uint64_t bytes) {
    Bytes message = framed(type, "", {});
    for (int k = 0; k < 8; ++k)
        message[42 + static_cast<std::size_t>(k)] = static_cast<unsigned char>(bytes >> (56 - 8 * k));
    return message;
}

TEST(Incoming, RefusesTooMuchAtTheHeader) {
    const Limits limits;
    for (const auto& [type, most] : std::vector<std::pair<const char*, std::uint64_t>>{
             {"IMAGE", limits.image_bytes}, {"POLYDATA", limits.mesh_bytes}, {"TRANSFORM", 48}, {"XYZ", 1 << 20}}) {
        Incoming incoming(limits);
        EXPECT_THAT([&] { incoming.feed(promise(type, most + 1)); }, ThrowsMessage<BadMessage>(HasSubstr("too long")));
        Incoming other(limits);
        EXPECT_THAT([&] { other.feed(promise(type, ~0ull)); }, ThrowsMessage<BadMessage>(HasSubstr("too long")));
    }
}

TEST(Incoming, MemoryFollowsWhatArrived) {
    const Limits limits;
    Incoming incoming(limits);
    incoming.feed(promise("IMAGE", limits.image_bytes));
    incoming.feed(Bytes(1000, 0));
    EXPECT_LT(incoming.kept_bytes(), 8000u);
}

TEST(Incoming, AWrongChecksumIsNoMessage) {
    Bytes message = text_message("hello");
    message.back() ^= 1;
    const Limits limits;
    Incoming incoming(limits);
    EXPECT_THAT([&] { incoming.feed(message); }, ThrowsMessage<BadMessage>(HasSubstr("checksum")));
}

TEST(Incoming, OtherVersionsAndNamelessTypesAreNoMessages) {
    const Limits limits;
    for (const int version : {0, 3, 256}) {
        Bytes message = text_message("hello");
        message[0] = static_cast<unsigned char>(version >> 8);
        message[1] = static_cast<unsigned char>(version);
        Incoming incoming(limits);
        EXPECT_THROW(incoming.feed(message), BadMessage) << version;
    }
    Bytes message = text_message("hello");
    message[2] = '\n';
    Incoming incoming(limits);
    EXPECT_THROW(incoming.feed(message), BadMessage);
}

TEST(Wire, ContentOfVersionTwoLiesBetweenHeaderAndMetadata) {
    Writer body;
    body.u16(12);
    body.u16(2);
    body.u32(3);
    body.u32(77);
    body.text("content", 7);
    body.text("mmddd", 5);
    const Header header{2, "STRING", "", 0, body.bytes().size(), 0};
    const ByteView content = content_of(header, body.bytes());
    EXPECT_EQ(std::string(content.begin(), content.end()), "content");
    body.bytes()[1] = 200;
    EXPECT_THROW(content_of(header, body.bytes()), BadMessage);
}

Parcel parcel(const std::string& key, unsigned char byte) {
    return {key, {std::make_shared<const Bytes>(Bytes(4, byte))}};
}

/// The first bytes of all messages, as they would go out.
std::vector<int> order(Outgoing outgoing) {
    std::vector<int> bytes;
    for (; outgoing.waiting() > 0; outgoing.sent(outgoing.next().size())) bytes.push_back(outgoing.next()[0]);
    return bytes;
}

TEST(Outgoing, TheNewestStateTakesThePlaceOfWhatWasNotBegun) {
    Outgoing outgoing;
    outgoing.add(parcel("organ", 1));
    outgoing.add(parcel("", 2));
    outgoing.add(parcel("organ", 3));
    EXPECT_EQ(order(outgoing), (std::vector{3, 2}));  // what is said after a state arrives after it or a newer one
    outgoing.sent(1);
    outgoing.add(parcel("organ", 4));  // what has begun goes to its end
    outgoing.add(parcel("organ", 5));
    EXPECT_EQ(order(outgoing), (std::vector{3, 2, 5}));
}

TEST(Outgoing, AStateIsSentWholeAndItsAnswerIsNotLost) {
    Outgoing outgoing;
    const auto state = [](unsigned char answer, bool answers) {
        Parcel both = parcel("update", answer);
        both.messages.push_back(parcel("", static_cast<unsigned char>(answer + 1)).messages.front());
        both.answers = answers;
        return both;
    };
    outgoing.add(state(10, true));
    outgoing.add(parcel("", 2));
    outgoing.add(state(20, false));
    EXPECT_EQ(order(outgoing), (std::vector{10, 20, 21, 2}));
    outgoing.sent(4);
    outgoing.sent(4);
    outgoing.add(state(30, false));  // between the answer and what it answers nothing gets
    EXPECT_EQ(order(outgoing), (std::vector{21, 2, 30, 31}));
}

}  // namespace
}  // namespace tissuewarp::server
