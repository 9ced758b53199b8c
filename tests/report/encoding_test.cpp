/// OpenCV reads back what was encoded.
#include "report/detail/encoding.hpp"

#include "core/errors.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace tissuewarp::report::detail {
namespace {

/// Smooth, with another slope in each channel, of an odd number of rows and columns.
cv::Mat example() {
    cv::Mat picture(37, 53, CV_8UC3);
    for (int row = 0; row < picture.rows; ++row)
        for (int column = 0; column < picture.cols; ++column)
            picture.at<cv::Vec3b>(row, column) =
                cv::Vec3b(static_cast<unsigned char>(4 * column), static_cast<unsigned char>(6 * row), 90);
    return picture;
}

TEST(Encoding, PngKeepsEveryPixel) {
    const cv::Mat picture = example(), read = cv::imdecode(png(picture), cv::IMREAD_COLOR);
    ASSERT_EQ(read.size(), picture.size());
    EXPECT_EQ(cv::norm(read, picture, cv::NORM_INF), 0);
}

TEST(Encoding, TakesPartsOfPictures) {
    const cv::Mat part = example()(cv::Rect(5, 7, 20, 11)), read = cv::imdecode(png(part), cv::IMREAD_COLOR);
    ASSERT_EQ(read.size(), part.size());
    EXPECT_EQ(cv::norm(read, part, cv::NORM_INF), 0);
}

TEST(Encoding, JpegKeepsColoursNearly) {
    const cv::Mat picture = example();
    const std::vector<unsigned char> bytes = jpeg(picture, 90);
    EXPECT_LT(bytes.size(), picture.total());
    const cv::Mat read = cv::imdecode(bytes, cv::IMREAD_COLOR);
    ASSERT_EQ(read.size(), picture.size());
    EXPECT_LT(cv::norm(read, picture, cv::NORM_L1) / static_cast<double>(3 * picture.total()), 2.0);
}

TEST(Encoding, RefusesGreyAndEmptyPictures) {
    for (const cv::Mat& odd : {cv::Mat(), cv::Mat(4, 4, CV_8UC1)}) {
        EXPECT_THROW(png(odd), InvalidInput);
        EXPECT_THROW(jpeg(odd, 75), InvalidInput);
    }
}

}  // namespace
}  // namespace tissuewarp::report::detail
