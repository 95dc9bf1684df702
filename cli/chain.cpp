#include "cli/chain.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <optional>

#include "base/error.h"

namespace fathom::cli {

namespace {

constexpr int kDeepestChainFile = 16;               // files that name files
constexpr size_t kMostChainText = size_t(1) << 20;  // bytes of all: files that name files multiply

std::string nearestName(const std::string& name) {
  for (const OperationSpec& spec : operations())
    if (spec.name.starts_with(name) || name.starts_with(spec.name)) return fmt::format("; is it --{}?", spec.name);
  return "";
}

// Reads words from the left.
class Parser {
 public:
  explicit Parser(std::span<const std::string> words) : words_(words) {}

  Chain parse() {
    while (at_ < words_.size()) {
      const std::string& word = words_[at_++];
      if (word == "-o" || word == "--output")
        addOutput();
      else if (word.starts_with("--"))
        addOperation(word.substr(2));
      else if (word.size() > 1 && word[0] == '-')
        fail("{}: expected a file, an operation such as --flatten, or -o", printable(word));
      else
        addImage(word);
    }
    if (chain_.nodes.empty()) fail("expected an image, found an empty chain");
    return std::move(chain_);
  }

 private:
  // The next word, where it is name=value with one of these names, or a name alone that is a flag's.
  std::optional<std::pair<std::string, std::string>> nextArgument(std::span<const ArgumentSpec> specs) {
    if (at_ == words_.size()) return {};
    const std::string& word = words_[at_];
    const size_t equals = word.find('=');
    const std::string name = word.substr(0, equals);
    const auto spec = std::ranges::find(specs, name, &ArgumentSpec::name);
    if (spec == specs.end() || (equals == word.npos && spec->type != ArgumentType::Flag)) return {};
    ++at_;
    return std::pair{name, equals == word.npos ? "1" : word.substr(equals + 1)};
  }

  // Required arguments that have not been named are taken by place.
  std::map<std::string, std::string> takeArguments(std::span<const ArgumentSpec> specs) {
    std::map<std::string, std::string> given;
    while (true) {
      if (const auto named = nextArgument(specs)) {
        if (!given.insert(*named).second) fail("{}: expected once, found twice", named->first);
        continue;
      }
      const auto open = std::ranges::find_if(
          specs, [&](const ArgumentSpec& spec) { return spec.required && !given.contains(spec.name); });
      if (open == specs.end() || at_ == words_.size() || words_[at_].starts_with("--")) return given;
      given[open->name] = words_[at_++];
    }
  }

  void addImage(const std::string& word) {
    static const std::vector<ArgumentSpec> specs = {{"part", ArgumentType::Text, "", ""}};
    ChainNode node{parsePattern(word), {}, nullptr, {}, {}};
    const auto given = takeArguments(specs);
    if (given.contains("part")) node.part = given.at("part");
    push(std::move(node));
  }

  void addOutput() {
    static const std::vector<ArgumentSpec> specs = {{"half", ArgumentType::Flag, "0", ""}};
    if (at_ == words_.size()) fail("-o: expected a file, found nothing");
    const std::string& file = words_[at_++];
    if (!file.ends_with(".exr") && !file.ends_with(".png"))
      fail("-o: expected a name that ends in .exr or .png, found {}", printable(file));
    chain_.outputs.push_back(
        {top("-o"), parsePattern(file), Arguments("-o", specs, takeArguments(specs)).flag("half")});
  }

  void addOperation(const std::string& name) {
    if (name == "dup") return stack_.push_back(top("--dup"));
    if (name == "pop") return pop("--pop", 1), void();
    if (name == "swap") {
      const std::vector<size_t> two = pop("--swap", 2);
      stack_.insert(stack_.end(), two.rbegin(), two.rend());
      return;
    }
    const OperationSpec* spec = findOperation(name);
    if (!spec) fail("--{}: expected an operation, found none of that name{}", printable(name), nearestName(name));
    ChainNode node{{}, {}, spec, takeArguments(spec->arguments), {}};
    const Arguments checked("--" + name, spec->arguments, node.arguments);
    node.inputs = pop("--" + name, spec->more ? std::max(stack_.size(), spec->inputs.size()) : spec->inputs.size());
    push(std::move(node));
  }

  void push(ChainNode node) {
    stack_.push_back(chain_.nodes.size());
    chain_.nodes.push_back(std::move(node));
  }
  size_t top(const std::string& who) {
    if (stack_.empty()) fail("{}: expected an image on the stack, found none", who);
    return stack_.back();
  }
  std::vector<size_t> pop(const std::string& who, size_t count) {
    if (stack_.size() < count)
      fail("{}: expected {} image{} on the stack, found {}", who, count, count == 1 ? "" : "s", stack_.size());
    std::vector<size_t> taken(stack_.end() - std::ptrdiff_t(count), stack_.end());
    stack_.resize(stack_.size() - count);
    return taken;
  }

  std::span<const std::string> words_;
  size_t at_ = 0;
  std::vector<size_t> stack_;
  Chain chain_;
};

// What a file holds; `left`: how much of kMostChainText is, of which the file takes its part.
std::string textOf(const std::string& path, size_t& left) {
  std::ifstream file(path);
  std::string text(left + 1, '\0');
  file.read(text.data(), std::streamsize(text.size()));
  if (!file.is_open() || file.bad())
    fail("{}: expected the text of a chain, found a file that cannot be read", printable(path));
  text.resize(size_t(file.gcount()));
  if (text.size() >= left) fail("{}: expected chains of at most {} bytes, found more", printable(path), kMostChainText);
  left -= text.size() + 1;
  return text;
}

void expand(std::span<const std::string> words, int depth, size_t& left, std::vector<std::string>& result) {
  for (size_t i = 0; i < words.size(); ++i) {
    if (words[i] != "--chain") {
      result.push_back(words[i]);
      continue;
    }
    if (++i == words.size()) fail("--chain: expected a file, found nothing");
    if (depth == kDeepestChainFile)
      fail("{}: expected chains that end, found files that name one another", printable(words[i]));
    const std::string text = textOf(words[i], left);
    try {
      expand(chainWords(text), depth + 1, left, result);
    } catch (const Error& e) {
      fail("{}: {}", printable(words[i]), e.what());
    }
  }
}

std::string quoted(const std::string& word) {
  if (!word.empty() && word[0] != '#' && word.find_first_of(" \t\r\n\v\f\"\\") == word.npos) return word;
  std::string text = "\"";
  for (const char c : word) {
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  return text + "\"";
}

}  // namespace

Chain parseChain(std::span<const std::string> words) {
  return Parser(words).parse();
}

std::vector<std::string> chainWords(const std::string& text) {
  std::vector<std::string> words;
  bool inWord = false, inQuotes = false, lineBegins = true;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const bool space = std::isspace(static_cast<unsigned char>(c)) != 0;
    if (!inWord && c == '#' && lineBegins) {
      i = std::min(text.find('\n', i), text.size());
      continue;
    }
    if (space && !inQuotes) {
      lineBegins = c == '\n' || (lineBegins && !inWord);
      inWord = false;
      continue;
    }
    if (!inWord) words.emplace_back();
    inWord = true;
    lineBegins = false;
    if (c == '"')
      inQuotes = !inQuotes;
    else
      words.back() += c == '\\' && i + 1 < text.size() ? text[++i] : c;
  }
  if (inQuotes) fail("expected a quotation mark at the end of {}, found none", printable(words.back()));
  return words;
}

std::string chainText(std::span<const std::string> words) {
  std::string text;
  for (const std::string& word : words) {
    const bool begins = word.starts_with("--") || word == "-o";
    text += text.empty() ? "" : begins ? "\n" : " ";
    text += quoted(word);
  }
  return text + "\n";
}

std::vector<std::string> withChainFiles(std::span<const std::string> words) {
  std::vector<std::string> result;
  size_t left = kMostChainText;
  expand(words, 0, left, result);
  return result;
}

}  // namespace fathom::cli
