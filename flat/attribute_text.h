// The attributes of a file as text that keeps their type: how `flat::Image` carries them from read to write.
//
// "3" is an int, "3.0" a float, "1.0, 2.0" a vector of floats; all else is a string, and a string that would read as
// one of the former stands in quotes.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace fathom::flat {

std::string attributeText(std::span<const int> values);
std::string attributeText(std::span<const float> values);
std::string attributeText(std::string_view text);

using AttributeValue = std::variant<std::vector<int>, std::vector<float>, std::string>;

AttributeValue parseAttribute(std::string_view text);

}  // namespace fathom::flat
