#include "report/detail/template.hpp"
#include "report/detail/encoding.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace tissuewarp::report::detail {
namespace {

using nlohmann::json;

TEST(Template, PutsValuesInAndEscapesThem) {
    EXPECT_EQ(fill("<p title=\"{{name}}\">", {{"name", "<a href='x'>\"&"}}),
              "<p title=\"&lt;a href=&#39;x&#39;&gt;&quot;&amp;\">");
    EXPECT_EQ(fill("{{count}} {{missing}}.", {{"count", 12}}), "12 .");
}

TEST(Template, DoesNotFillWhatAValueHolds) {
    EXPECT_EQ(fill("{{a}}", {{"a", "{{b}}"}, {"b", 1}}), "{{b}}");
}

TEST(Template, RepeatsSectionsForLists) {
    const json values = {{"rows", {{{"x", 1}}, {{"x", 2}}}}, {"unit", "mm"}};
    EXPECT_EQ(fill("{{#rows}}{{x}} {{unit}};{{/rows}}", values), "1 mm;2 mm;");
    EXPECT_EQ(fill("{{#list}}[{{.}}]{{/list}}", {{"list", {"a", "b"}}}), "[a][b]");
}

TEST(Template, KeepsOrDropsSections) {
    const json values = {{"yes", true}, {"no", false}, {"none", nullptr},
                         {"zero", 0},   {"empty", ""}, {"o", {{"x", 3}}}};
    EXPECT_EQ(
        fill("{{#yes}}a{{/yes}}{{#no}}b{{/no}}{{#none}}c{{/none}}{{#zero}}d{{/zero}}{{#empty}}e{{/empty}}", values),
        "ad");
    EXPECT_EQ(fill("{{^yes}}a{{/yes}}{{^no}}b{{/no}}{{^absent}}c{{/absent}}{{^o}}d{{/o}}{{#o}}{{x}}{{/o}}", values),
              "bc3");
}

TEST(Template, NestsSectionsOfOneName) {
    const json values = {{"a", {{{"a", {1, 2}}}, {{"a", {3}}}}}};
    EXPECT_EQ(fill("{{#a}}({{#a}}{{.}}{{/a}}){{/a}}", values), "(12)(3)");
}

TEST(Template, RefusesSectionsThatDoNotClose) {
    EXPECT_THROW(fill("{{#a}}x", json::object()), std::logic_error);
}

/// The examples of RFC 4648, section 10.
TEST(Base64, AgreesWithTheStandard) {
    const auto encoded = [](const std::string& text) { return base64({text.begin(), text.end()}); };
    EXPECT_EQ(encoded(""), "");
    EXPECT_EQ(encoded("f"), "Zg==");
    EXPECT_EQ(encoded("fo"), "Zm8=");
    EXPECT_EQ(encoded("foo"), "Zm9v");
    EXPECT_EQ(encoded("foob"), "Zm9vYg==");
    EXPECT_EQ(encoded("fooba"), "Zm9vYmE=");
    EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
}

}  // namespace
}  // namespace tissuewarp::report::detail
