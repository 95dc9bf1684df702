#include "flat/attribute_text.h"

#include <gtest/gtest.h>

#include <limits>

namespace fathom::flat {
namespace {

using Ints = std::vector<int>;
using Floats = std::vector<float>;

TEST(AttributeText, NumbersComeBackWithTypeAndBits) {
  for (const Ints& values : {Ints{0}, Ints{-7}, Ints{1, 2, 3}, Ints{std::numeric_limits<int>::min()}})
    EXPECT_EQ(parseAttribute(attributeText(values)), AttributeValue(values)) << attributeText(values);
  for (const Floats& values : {Floats{0}, Floats{5}, Floats{-0.1f, 1e20f, 1e-40f}, Floats{3.4028235e38f, 1.0f / 3}})
    EXPECT_EQ(parseAttribute(attributeText(values)), AttributeValue(values)) << attributeText(values);
  EXPECT_EQ(attributeText(Floats{5}), "5.0");
}

TEST(AttributeText, StringsStayStrings) {
  for (const char* text : {"", "a", "3", "3.0", "1, 2", "\"", "\"\"", "\"quoted\"", "1e5", "nan", "inf", "5 m", "1,"})
    EXPECT_EQ(parseAttribute(attributeText(std::string_view(text))), AttributeValue(std::string(text))) << text;
  EXPECT_EQ(attributeText("made by hand"), "made by hand");
}

}  // namespace
}  // namespace fathom::flat
