/// Names of labels as other programs write them.
#include "imaging/label_names.hpp"

#include "core/errors.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tissuewarp::imaging {
namespace {

class LabelNamesTest : public testing::Test {
protected:
    std::filesystem::path file(const std::string& name, const std::string& text) const {
        return folder_.written(name, text);
    }
    LabelNames names(const std::string& name, const std::string& text) const {
        return read_label_names(file(name, text));
    }
    std::string refusal(const std::string& name, const std::string& text) const {
        try {
            read_label_names(file(name, text));
        } catch (const InvalidInput& refused) {
            return refused.what();
        }
        return "read";
    }

private:
    test::TemporaryFolder folder_;
};

const LabelNames lungs{{1, "left lung"}, {2, "right lung"}, {40, "heart, all"}};

TEST_F(LabelNamesTest, OfEveryTableAreThoseThatItsProgramShows) {
    EXPECT_EQ(names("slicer.ctbl",
                    "# Color table file C:/lungs.ctbl\n# 4 values\n0 Background 0 0 0 0\n1 left_lung 128 174 128 255\n"
                    "2 right_lung 241 214 145 255\n40 heart,_all 206 110 84 255\n"),
              lungs);
    EXPECT_EQ(names("freesurfer.txt",
                    "#No. Label Name: R G B A\n\n0\tUnknown\t0 0 0 0\n1\tleft_lung 70 130 180 0\r\n"
                    "2  right_lung   245 245 245   0\n40  heart,_all 205 62 78 0\n"),
              lungs);
    EXPECT_EQ(names("slicer.csv",
                    "LabelValue,Name,Color_R,Color_G,Color_B,Color_A,Type_CodeMeaning\n"
                    "1,left lung,128,174,128,255,Lung\n2,right lung,241,214,145,255,Lung\n"
                    "40,\"heart, all\",206,110,84,255,Heart\n"),
              lungs);
    EXPECT_EQ(names("terminology.csv", "LabelValue,Color_R,Color_G,Color_B,Type_CodeMeaning\n3,1,2,3,Liver\n"),
              (LabelNames{{3, "Liver"}}));
    EXPECT_EQ(names("snap.txt",
                    "################\n# ITK-SnAP Label Description File\n# IDX   -R-  -G-  -B-  -A--  VIS MSH\n"
                    "    0     0    0    0        0  0  0    \"Clear Label\"\n"
                    "    1   255    0    0        1  1  1    \"left lung\"\n"
                    "    2     0  255    0      0.5  1  1    \"right lung\"\n"
                    "   40     0    0  255        1  0  1    \"heart, all\"\n"),
              lungs);
}

TEST_F(LabelNamesTest, WhatIsNoTableOfNamesIsRefusedWithItsLine) {
    using testing::HasSubstr;
    EXPECT_THAT(refusal("scale.txt", "# Color procedural file\n# position R G B\n0 0 0 0\n63 0 0.5 0.49\n"),
                HasSubstr("scale.txt:3: is no label, name and colour"));
    EXPECT_THAT(refusal("words.ctbl", "1 left lung 128 174 128 255\n"), HasSubstr("words.ctbl:1"));
    EXPECT_THAT(refusal("two.ctbl", "1 liver 1 2 3 255\n1 spleen 1 2 3 255\n"),
                HasSubstr("two.ctbl:2: label 1 is named 'liver' above and 'spleen' here"));
    EXPECT_THAT(refusal("half.ctbl", "1.5 liver 1 2 3 255\n"), HasSubstr("'1.5' is no label"));
    EXPECT_THAT(refusal("none.ctbl", "0 background 0 0 0 0\n"), HasSubstr("names no label"));
    EXPECT_THAT(refusal("points.csv", "x,y,z\n1,2,3\n"), HasSubstr("has no columns LabelValue and Name"));
    EXPECT_THAT(refusal("empty.csv", ""), HasSubstr("has no columns LabelValue and Name"));
    EXPECT_THROW(read_label_names("absent.ctbl"), IoError);
}

TEST(LabelNames, StandBehindTheirLabels) {
    const LabelNames names{{2, "tumour"}, {12, "left lung"}};
    EXPECT_EQ(label_title(2, names), "label 2 (tumour)");
    EXPECT_EQ(label_title(1, names), "label 1");
    EXPECT_EQ(with_label_names("label 12 lies in label 1, not in label 2; check the label tables", names),
              "label 12 (left lung) lies in label 1, not in label 2 (tumour); check the label tables");
    EXPECT_EQ(with_label_names("label ", names), "label ");
    EXPECT_EQ(with_label_names("label 99999999999999999999", names), "label 99999999999999999999");
}

}  // namespace
}  // namespace tissuewarp::imaging
