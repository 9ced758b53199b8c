#include "shaders/buffer.hpp"
#include "core/errors.hpp"
#include "shaders/readback.hpp"
#include "shaders/upload.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <numeric>

namespace tissuewarp::shaders {
namespace {

class BufferTest : public ::testing::Test {
protected:
    Device device;
    CurrentContext current = device.make_current();
};

TEST_F(BufferTest, IsZeroAtFirst) {
    const Buffer<float> buffer(device, 1000, "values");
    EXPECT_THAT(buffer.download(), ::testing::Each(0.0F));
}

TEST_F(BufferTest, GivesBackWhatWasWritten) {
    std::vector<int> values(10000);
    std::iota(values.begin(), values.end(), -5000);
    const Buffer<int> buffer(device, values, "values");
    EXPECT_EQ(buffer.download(), values);
}

TEST_F(BufferTest, WritesAndReadsARange) {
    Buffer<int> buffer(device, std::vector<int>{0, 1, 2, 3, 4}, "values");
    buffer.upload(std::vector<int>{20, 30}, 2);
    EXPECT_EQ(buffer.download(), (std::vector<int>{0, 1, 20, 30, 4}));
    std::vector<int> tail(2);
    buffer.download(tail, 3);
    EXPECT_EQ(tail, (std::vector<int>{30, 4}));
}

TEST_F(BufferTest, CopiesAndClears) {
    const Buffer<int> from(device, std::vector<int>{7, 8, 9}, "from");
    Buffer<int> to(device, 3, "to");
    to.copy_from(from, 2 * sizeof(int));
    EXPECT_EQ(to.download(), (std::vector<int>{7, 8, 0}));
    to.clear();
    EXPECT_EQ(to.download(), (std::vector<int>{0, 0, 0}));
}

TEST_F(BufferTest, RefusesARangeOutsideItself) {
    Buffer<int> buffer(device, 3, "values");
    EXPECT_THROW(buffer.upload(std::vector<int>{1, 2}, 2), InvalidInput);
    std::vector<int> two(2);
    EXPECT_THROW(buffer.download(two, 2), InvalidInput);
    Buffer<int> larger(device, 4, "larger");
    EXPECT_THROW(buffer.copy_from(larger, larger.bytes()), InvalidInput);
}

TEST_F(BufferTest, ComesDownThroughMappedMemory) {
    std::vector<int> values(100000);
    std::iota(values.begin(), values.end(), 7);
    Buffer<int> buffer(device, values, "values");
    Readback readback(device, buffer.bytes(), "mapped values");
    const auto fetched = [&](std::size_t count) {
        const std::span<const std::byte> bytes = readback.fetch(buffer, count * sizeof(int));
        const auto* first = reinterpret_cast<const int*>(bytes.data());
        return std::vector<int>(first, first + bytes.size() / sizeof(int));
    };
    EXPECT_EQ(fetched(values.size()), values);
    values[99999] = -1;
    buffer.upload(values);
    EXPECT_EQ(fetched(values.size()), values);
    EXPECT_EQ(fetched(2), (std::vector<int>{7, 8}));
    EXPECT_TRUE(fetched(0).empty());
}

TEST_F(BufferTest, SeveralComeDownTogether) {
    const std::vector<int> one{1, 2, 3}, other{4, 5};
    const Buffer<int> first(device, one, "one"), empty(device, 1, "nothing of it"), second(device, other, "other");
    const std::array pieces{Readback::Piece{first, first.bytes()}, Readback::Piece{empty, 0},
                            Readback::Piece{second, second.bytes()}};
    Readback readback(device, Readback::bytes_of(pieces), "mapped values");
    const auto fetched = readback.fetch(pieces);
    const auto values = [&](std::size_t n) {
        const auto* begin = reinterpret_cast<const int*>(fetched.at(n).data());
        return std::vector<int>(begin, begin + fetched[n].size() / sizeof(int));
    };
    EXPECT_EQ(values(0), one);
    EXPECT_TRUE(values(1).empty());
    EXPECT_EQ(values(2), other);
    Readback smaller(device, first.bytes(), "too little");
    EXPECT_THROW((void)smaller.fetch(pieces), InvalidInput);
}

TEST_F(BufferTest, RefusesToComeDownIntoLess) {
    const Buffer<int> small(device, 3, "small"), large(device, 5, "large");
    Readback readback(device, 4 * sizeof(int), "mapped values");
    EXPECT_THROW((void)readback.fetch(small, 4 * sizeof(int)), InvalidInput);
    EXPECT_THROW((void)readback.fetch(large, 5 * sizeof(int)), InvalidInput);
}

// A device that reads mapped memory before it is filled, or after it was filled anew.
TEST_F(BufferTest, IsFilledFromMappedMemoryAgainAndAgain) {
    Buffer<int> buffer(device, 100000, "values");
    Upload upload(device, buffer.bytes(), "values on their way");
    for (int round = 0; round < 5; ++round) {
        std::vector<int> values(buffer.size());
        std::iota(values.begin(), values.end(), 1000 * round);
        std::memcpy(upload.room().data(), values.data(), buffer.bytes());
        upload.send(buffer, buffer.bytes());
        EXPECT_EQ(buffer.download(), values) << round;
    }
    EXPECT_THROW((void)upload.send(Buffer<int>(device, 3, "small"), 4 * sizeof(int)), InvalidInput);
    EXPECT_THROW((void)upload.send(Buffer<int>(device, 200000, "large"), 200000 * sizeof(int)), InvalidInput);
}

TEST_F(BufferTest, MayBeEmpty) {
    const Buffer<int> buffer(device, 0, "nothing");
    EXPECT_TRUE(buffer.download().empty());
}

TEST_F(BufferTest, RefusesMoreThanAStorageBlockHoldsAndSaysSo) {
    const std::size_t bytes = device.limits().storage_buffer_bytes + 4;
    try {
        const Buffer<std::byte> buffer(device, bytes, "corner forces");
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("corner forces take"));
        EXPECT_THAT(error.what(), ::testing::HasSubstr("MiB"));
    }
}

}  // namespace
}  // namespace tissuewarp::shaders
