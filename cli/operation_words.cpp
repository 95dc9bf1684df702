#include "cli/operation_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>

#include "base/error.h"

namespace fathom::cli {

std::string usageOf(const OperationSpec& spec) {
  std::string text = "--" + spec.name;
  for (const ArgumentSpec& argument : spec.arguments) {
    std::string word = argument.required                     ? argument.name
                       : argument.type == ArgumentType::Flag ? argument.name
                                                             : argument.name + "=";
    if (argument.required)
      std::ranges::transform(word, word.begin(), [](unsigned char c) { return char(std::toupper(c)); });
    text += argument.required ? " " + word : " [" + word + "]";
  }
  return text;
}

std::string describeArguments(const OperationSpec& spec) {
  std::string text;
  for (const ArgumentSpec& argument : spec.arguments) {
    std::string fallback;
    if (!argument.fallback.empty() && argument.type != ArgumentType::Flag)
      fallback = fmt::format(" (default: {})", argument.fallback);
    std::string choices;
    for (const std::string& choice : argument.choices)
      if (argument.help.find(argument.choices[0]) == std::string::npos)
        choices += (choices.empty() ? ": " : ", ") + choice;
    text += fmt::format("  {:<14} {}{}{}\n", argument.type == ArgumentType::Flag ? argument.name : argument.name + "=",
                        argument.help, choices, fallback);
  }
  return text;
}

std::string operationList() {
  std::string text;
  for (const OperationSpec& spec : operations()) text += fmt::format("  {}\n      {}\n", usageOf(spec), spec.help);
  return text;
}

std::vector<std::string> chainOfOne(const OperationSpec& spec, const std::vector<std::string>& words) {
  std::vector<std::string> images, arguments{"--" + spec.name}, outputs;
  std::string part;  // named before any image: the first one's
  const auto isArgument = [&](const std::string& name) {
    return std::ranges::find(spec.arguments, name, &ArgumentSpec::name) != spec.arguments.end();
  };
  const auto isFlag = [&](const std::string& name) {
    const auto found = std::ranges::find(spec.arguments, name, &ArgumentSpec::name);
    return found != spec.arguments.end() && found->type == ArgumentType::Flag;
  };
  for (size_t i = 0; i < words.size(); ++i) {
    std::string word = words[i];
    const bool dashed = word.starts_with("--");
    if (word == "-o" || word == "--output") {
      outputs.insert(outputs.end(), {"-o", i + 1 < words.size() ? words[i + 1] : ""});
      ++i;
      continue;
    }
    if (dashed) word.erase(0, 2);
    const size_t equals = word.find('=');
    const std::string name = word.substr(0, equals);
    const bool complete = isArgument(name) && (equals != word.npos || isFlag(name));
    if (name == "part" || (name == "half" && equals != word.npos && !isArgument(name))) {
      const std::string value = equals != word.npos    ? word
                                : i + 1 < words.size() ? word + "=" + words[++i]
                                                       : word + "=";
      if (name == "part" && images.empty())
        part = value;
      else
        (name == "part" ? images : outputs).push_back(value);
    } else if (dashed && !complete) {
      if (!isArgument(name) || i + 1 == words.size())
        fail("{}: expected an option that it has, with a value; found --{}", spec.name, printable(name));
      arguments.push_back(name + "=" + words[++i]);
    } else if (!complete && (spec.more || images.size() < spec.inputs.size())) {
      images.push_back(word);
      if (!part.empty()) images.push_back(std::exchange(part, ""));
    } else {
      arguments.push_back(word);
    }
  }
  std::vector<std::string> chain = images;
  chain.insert(chain.end(), arguments.begin(), arguments.end());
  chain.insert(chain.end(), outputs.begin(), outputs.end());
  return chain;
}

}  // namespace fathom::cli
